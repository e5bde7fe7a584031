// Draws every figure of the page, and redraws them when the width or the theme changes.

// ---- figures ----

function size(host) {
  return { width: Math.max(120, host.clientWidth), height: Math.max(80, host.clientHeight) };
}

/** Indices of single samples between two gaps, for which a line would show nothing. */
function lonePoints(u, k) {
  const ys = u.data[k];
  const lone = [];
  for (let i = 0; i < ys.length; i++)
    if (ys[i] != null && ys[i - 1] == null && ys[i + 1] == null) lone.push(i);
  return lone;
}

function timeChart(host, figure, track, panel, last) {
  const log = typeof panel.scale === "object" ? panel.scale.log : null;
  const level = panel.rules.map((r) => r.value);
  const values = panel.series.map((s) =>
    log ? s.values.map((v) => (v == null ? null : Math.max(v, log.floor))) : s.values);
  const range = (u, low, high) => {
    // Half a decade of room, so that the highest tick stays clear of the marks.
    if (log) return [log.floor, 3 * Math.max(high || log.floor, log.floor * 10, ...level)];
    return padded(Math.min(low ?? Infinity, ...level), Math.max(high ?? -Infinity, ...level));
  };
  const outputs = legend(host, [
    ...panel.series.map((s) => ({ label: s.label, style: s.style })),
    ...panel.bands.map((b) => ({ label: `${b.label} ±${showChosen(b.half_width)}`, shape: "band", fixed: true })),
  ], (i) => {
    u.setSeries(i + 1, { show: !u.series[i + 1].show });
    return u.series[i + 1].show;
  });
  const options = {
    ...size(host),
    padding: [figure.marks.length ? 1.1 * rem() : 0.5 * rem(), rem(), 0, 0],
    legend: { show: false },
    cursor: {
      y: false, sync: { key: sync.key, scales: ["x", null] },
      drag: { x: true, y: false, setScale: true, dist: 4 },
      points: { size: 6 },
      bind: { dblclick: () => () => { lookAtAll(); return null; } },
    },
    scales: {
      x: { time: false, range: (u, low, high) => [low, high] },
      y: { distr: log ? 3 : 1, log: 10, range },
    },
    axes: [
      axis({
        size: (last ? 1.6 : 0.5) * rem(), values: last ? showTicks : () => [], space: 4.5 * rem(),
        label: last ? "Time (s)" : undefined, labelSize: last ? 1.3 * rem() : 0, labelGap: 0,
      }),
      sideAxis(log ? { splits: decades, values: (u, s) => s.map(showDecade), filter: (u, s) => s } : {}),
    ],
    series: [{}, ...panel.series.map((s) => ({
      label: s.label, stroke: style(s.style), dash: DASH[s.style], width: Math.max(1.5, 0.1 * rem()) * (s.style === "measured" ? 2.6 : 1),
      points: { size: 3, show: true, filter: lonePoints }, spanGaps: false, pxAlign: 0,
    }))],
    hooks: {
      drawAxes: [(u) => { panel.bands.forEach((b) => drawBand(u, b)); drawMarks(u, figure.marks); }],
      draw: [(u) => panel.rules.forEach((r) => drawLevel(u, r))],
      setScale: [(u, key) => { if (key === "x" && !spreading && u.status) look(u.scales.x.min, u.scales.x.max); }],
      setCursor: [(u) => panel.series.forEach((s, i) => {
        const k = u.cursor.left >= 0 ? u.cursor.idx : null;
        outputs[i].textContent = k == null ? "" : show(s.values[k]) || "no data";
      })],
    },
  };
  const u = new uPlot(options, [track.time_s, ...values], host);
  spreading = true;
  u.setScale("x", { min: view[0], max: view[1] });
  spreading = false;
  keys(host, u);
  wheel(u);
  touch(u);
  timeCharts.push(u);
  return u;
}

function histogramChart(host, data) {
  const { edges, counts } = data;
  const note = host.parentElement.querySelector(".readout");
  const bars = (u) => clipped(u, (ctx, b) => {
    ctx.fillStyle = style("actual");
    const at = (v) => Math.round(u.valToPos(v, "x", true));
    counts.forEach((n, i) => {
      if (!n) return;
      const top = Math.round(u.valToPos(n, "y", true));
      ctx.fillRect(at(edges[i]), top, Math.max(px(), at(edges[i + 1]) - at(edges[i]) - px()), b.top + b.height - top);
    });
  });
  return new uPlot({
    ...size(host), padding: [0.5 * rem(), rem(), 0, 0], legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
    scales: {
      x: { time: false, distr: 3, log: 10, range: () => [edges[0], edges[edges.length - 1]] },
      y: { distr: 3, log: 10, range: () => [0.7, Math.max(1, ...counts) * 12] },
    },
    axes: [
      axis({ size: 1.7 * rem(), splits: decadesFine, values: showFine, space: 3 * rem(), filter: (u, s) => s, label: data.x_label, labelSize: 1.4 * rem(), labelGap: 0 }),
      sideAxis({ splits: decades, values: (u, s) => s.map(showDecade), filter: (u, s) => s }),
    ],
    series: [{}, { stroke: style("actual"), paths: () => null, points: { show: false } }],
    hooks: {
      drawAxes: [bars],
      draw: [(u) => drawUprights(u, data.rules)],
      setCursor: [(u) => {
        const v = u.posToVal(u.cursor.left, "x");
        const i = u.cursor.left < 0 ? -1 : edges.findIndex((e, k) => v >= e && v < edges[k + 1]);
        note.textContent = i < 0 ? "" : `${show(edges[i])} to ${show(edges[i + 1])}: ${counts[i]} ${data.counted}`;
      }],
    },
  }, [edges.slice(0, -1), counts.map((n) => n || null)], host);
}

const SHAPES = {
  line(ctx, points) {
    ctx.lineWidth = Math.max(2, 0.14 * rem()) * px();
    ctx.beginPath();
    let pen = false;
    for (const p of points) {
      if (p) pen ? ctx.lineTo(...p) : ctx.moveTo(...p);
      pen = p != null;
    }
    ctx.stroke();
  },
  dots(ctx, points) {
    ctx.globalAlpha = 0.55;
    for (const p of points.filter(Boolean)) {
      ctx.beginPath();
      ctx.arc(...p, 1.8 * px(), 0, 7);
      ctx.fill();
    }
  },
  path(ctx, points) {
    ctx.lineWidth = 1.2 * px();
    ctx.globalAlpha = 0.75;
    ctx.beginPath();
    let pen = false;
    for (const p of points) {
      if (p) pen ? ctx.lineTo(...p) : ctx.moveTo(...p);
      pen = p != null;
    }
    ctx.stroke();
  },
  circles(ctx, points) {
    ctx.lineWidth = 2 * px();
    for (const p of points.filter(Boolean)) {
      ctx.beginPath();
      ctx.arc(...p, 5 * px(), 0, 7);
      ctx.stroke();
    }
  },
  crosses(ctx, points) {
    ctx.lineWidth = 2 * px();
    const r = 5 * px();
    for (const [x, y] of points.filter(Boolean)) {
      ctx.beginPath();
      ctx.moveTo(x - r, y - r); ctx.lineTo(x + r, y + r);
      ctx.moveTo(x - r, y + r); ctx.lineTo(x + r, y - r);
      ctx.stroke();
    }
  },
};
function extent(lists) {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists) for (const v of list) if (v != null) { low = Math.min(low, v); high = Math.max(high, v); }
  return padded(low, high);
}
function xyChart(host, data) {
  const shown = data.series.map(() => true);
  const lists = [...data.series, ...data.bands.flatMap((b) => [{ x: b.x, y: b.low }, { x: b.x, y: b.high }])];
  const [xr, yr] = [extent(lists.map((s) => s.x)), extent(lists.map((s) => s.y))];
  const bands = (u) => clipped(u, (ctx) => data.bands.forEach((b) => {
    ctx.fillStyle = style("band");
    ctx.beginPath();
    const at = (i, y) => y[i] != null && ctx.lineTo(u.valToPos(b.x[i], "x", true), u.valToPos(y[i], "y", true));
    for (let i = 0; i < b.x.length; i++) at(i, b.high);
    for (let i = b.x.length - 1; i >= 0; i--) at(i, b.low);
    ctx.fill();
  }));
  const draw = (u) => clipped(u, (ctx) => data.series.forEach((s, k) => {
    if (!shown[k]) return;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = style(s.style);
    SHAPES[s.mark](ctx, s.x.map((x, i) =>
      x == null || s.y[i] == null ? null : [u.valToPos(x, "x", true), u.valToPos(s.y[i], "y", true)]));
    ctx.restore();
  }));
  legend(host, [
    ...data.series.map((s) => ({ label: s.label, style: s.style, shape: s.mark })),
    ...data.bands.map((b) => ({ label: b.label, shape: "band", fixed: true })),
  ], (i) => {
    shown[i] = !shown[i];
    u.redraw();
    return shown[i];
  });
  const u = new uPlot({
    ...size(host), padding: [0.5 * rem(), rem(), 0, 0], legend: { show: false },
    cursor: { drag: { x: true, y: true, dist: 4 }, points: { show: false } },
    scales: {
      x: { time: false, range: (u, a, b) => (a === xr[0] && b === xr[1] ? xr : [a, b]) },
      y: { range: (u, a, b) => [a, b] },
    },
    axes: [
      axis({ size: 1.7 * rem(), values: showTicks, space: 3.5 * rem(), label: data.x_label, labelSize: 1.4 * rem(), labelGap: 0 }),
      sideAxis({ label: data.y_label, labelSize: 1.4 * rem(), labelGap: 0 }),
    ],
    series: [{}, { paths: () => null, points: { show: false } }],
    // The bands are drawn first, so that they lie behind the series.
    hooks: { draw: [bands, draw] },
    // uPlot sets its scales by two invisible corner points. The hooks draw the figure.
  }, [xr, yr], host);
  return u;
}

// ---- the page ----

function columns(host) {
  return getComputedStyle(host.closest(".panels")).gridTemplateColumns.split(" ").length;
}
const DRAWN = { xy: xyChart, histogram: histogramChart, intervals: intervalChart, heat: heatChart, curves: curvesChart };
function build() {
  for (const u of charts) u.destroy();
  charts = [];
  timeCharts = [];
  const shown = [...document.querySelectorAll(".plot")].filter((host) => !hidden(host));
  newClock(shown.map((host) => figures[host.dataset.figure]).filter((f) => f.kind === "time"));
  for (const host of shown) {
    const { kind, data } = figures[host.dataset.figure];
    if (kind === "time") {
      const track = data.tracks[host.dataset.track];
      const all = [...host.closest(".panels").querySelectorAll(".plot")];
      // Only the lowest panel of each column carries the time axis.
      const last = all.indexOf(host) >= all.length - columns(host);
      host.style.height = last ? `calc(var(--plot-height) + 2.2rem)` : "";
      charts.push(timeChart(host, data, track, track.panels[host.dataset.panel], last));
    } else charts.push(DRAWN[kind](host, data));
  }
  tell();
  root.dataset.charts = charts.length;
}

document.getElementById("theme").onclick = () => {
  root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  build();
};
reset.onclick = lookAtAll;
for (const button of document.querySelectorAll("button.zoom")) {
  button.onclick = () => {
    const [from, to] = [Number(button.dataset.from), Number(button.dataset.to)];
    look(from, to);
    document.querySelector(".panels")?.scrollIntoView({ block: "start" });
  };
}
let drawnWidth = innerWidth;
let waiting = 0;
addEventListener("resize", () => {
  // A phone's address bar changes only the height, which needs no redraw.
  if (innerWidth === drawnWidth) return;
  drawnWidth = innerWidth;
  clearTimeout(waiting);
  waiting = setTimeout(build, 120);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (e) => {
  root.dataset.theme = e.matches ? "dark" : "light";
  build();
});
let screenTheme = null;
addEventListener("beforeprint", () => {
  screenTheme ??= root.dataset.theme;
  root.dataset.theme = "light";
  root.classList.add("printing");
  build();
});
addEventListener("afterprint", () => {
  root.dataset.theme = screenTheme ?? root.dataset.theme;
  screenTheme = null;
  root.classList.remove("printing");
  build();
});
build();
root.dataset.ready = "yes";
