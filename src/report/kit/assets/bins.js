// Charts of means in bins, heat maps and curves; and the choices that show one of several figures.

const counted = (n) => `${n} ${n === 1 ? "sample" : "samples"}`;
function span(from, to, unit) {
  const u = unit ? ` ${unit}` : "";
  if (from == null) return to == null ? "all" : `under ${show(to)}${u}`;
  return to == null ? `over ${show(from)}${u}` : `${show(from)} to ${show(to)}${u}`;
}
/** Arrow keys step through the `count` points of a plot. `at(i)` shows the values at point i, `at(-1)` shows none. */
function stepping(host, count, at) {
  let i = -1;
  host.onkeydown = (e) => {
    const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[e.key];
    if (e.key === "Escape") i = -1;
    else if (by && !e.ctrlKey && !e.metaKey && !e.altKey) i = i < 0 ? (by > 0 ? 0 : count - 1) : (i + by + count) % count;
    else return;
    e.preventDefault();
    at(i);
  };
}

// ---- means in bins ----

/** The vertical range that all panels of a figure share. It covers the bins with enough samples, else all bins. */
function intervalRange(data) {
  for (const supportedOnly of [true, false]) {
    let [low, high] = [0, 0];
    for (const { lines } of data.panels) for (const b of lines) b.mean.forEach((m, i) => {
      if (supportedOnly && !b.supported[i]) return;
      for (const v of [m, b.low[i], b.high[i]]) if (v != null) { low = Math.min(low, v); high = Math.max(high, v); }
    });
    if (low < high) return padded(low, high);
  }
  return [-1, 1];
}
const MARKS = [
  (ctx, x, y, r) => ctx.arc(x, y, r, 0, 7),
  (ctx, x, y, r) => ctx.rect(x - r, y - r, 2 * r, 2 * r),
  (ctx, x, y, r) => { ctx.moveTo(x, y - 1.4 * r); ctx.lineTo(x + 1.4 * r, y); ctx.lineTo(x, y + 1.4 * r); ctx.lineTo(x - 1.4 * r, y); ctx.closePath(); },
  (ctx, x, y, r) => { ctx.moveTo(x, y - 1.3 * r); ctx.lineTo(x + 1.3 * r, y + r); ctx.lineTo(x - 1.3 * r, y + r); ctx.closePath(); },
];
function intervalChart(host, data) {
  const panel = data.panels[host.dataset.panel];
  const note = host.parentElement.querySelector(".readout");
  const places = [];
  panel.lines.forEach((b, k) => b.center.forEach((x, i) => { if (x != null && b.mean[i] != null) places.push({ x, k, i }); }));
  places.sort((a, b) => a.x - b.x || a.k - b.k);
  const named = panel.names.length > 0;
  let [low, high] = [Infinity, -Infinity];
  for (const b of panel.lines) for (const v of [...b.center, ...b.from, ...b.to]) if (v != null) { low = Math.min(low, v); high = Math.max(high, v); }
  const xr = named ? [-0.6, panel.names.length - 0.4] : padded(low, high);
  const yr = intervalRange(data);
  let told = -1;
  // The models are side by side in a bin, so that none hides another.
  const aside = (k) => (k - (panel.lines.length - 1) / 2) * 6 * px();
  const draw = (u) => clipped(u, (ctx, box) => {
    const at = (v) => u.valToPos(v, "y", true);
    stroke(ctx, style("muted"), [], [[box.left, Math.round(at(0))], [box.left + box.width, Math.round(at(0))]]);
    places.forEach(({ x, k, i }, n) => {
      const b = panel.lines[k];
      const cx = u.valToPos(x, "x", true) + aside(k);
      ctx.strokeStyle = ctx.fillStyle = style(b.supported[i] ? data.keys[k][1] : "thin");
      ctx.lineWidth = (n === told ? 3 : 1.8) * px();
      ctx.beginPath();
      if (b.low[i] != null && b.high[i] != null) { ctx.moveTo(cx, at(b.low[i])); ctx.lineTo(cx, at(b.high[i])); }
      if (b.from[i] != null && b.to[i] != null && panel.lines.length === 1 && !named) {
        ctx.moveTo(u.valToPos(b.from[i], "x", true) + px(), at(b.mean[i]));
        ctx.lineTo(u.valToPos(b.to[i], "x", true) - px(), at(b.mean[i]));
      }
      ctx.stroke();
      ctx.beginPath();
      MARKS[k % MARKS.length](ctx, cx, at(b.mean[i]), (n === told ? 4.5 : 3.2) * px());
      ctx.fill();
    });
  });
  const tell = (n) => {
    if (n === told) return;
    told = n;
    u.redraw(false);
    if (n < 0) { note.textContent = ""; return; }
    const { k, i } = places[n];
    const b = panel.lines[k];
    const where = named ? panel.names[i] ?? "" : span(b.from[i], b.to[i], panel.unit);
    const half = b.low[i] == null ? "" : ` (${show(b.low[i])} to ${show(b.high[i])})`;
    note.textContent = `${where}: ${show(b.mean[i])}${half} ${data.unit}, ${counted(b.samples[i])}`;
  };
  const u = new uPlot({
    ...size(host), padding: [0.5 * rem(), rem(), 0, 0], legend: { show: false },
    cursor: { y: false, x: false, drag: { x: false, y: false }, points: { show: false } },
    scales: { x: { time: false, range: () => xr }, y: { range: () => yr } },
    axes: [
      axis(named
        ? { size: 1.7 * rem(), splits: (u) => thinned(u, panel.names), values: (u, s) => s.map((i) => shortened(panel.names[i] ?? "")), space: 10 }
        : { size: 1.7 * rem(), values: showTicks, space: 3.2 * rem() }),
      sideAxis({}),
    ],
    series: [{}, { paths: () => null, points: { show: false } }],
    hooks: {
      draw: [draw],
      setCursor: [(u) => {
        if (u.cursor.left < 0) return tell(-1);
        let [best, near] = [-1, Infinity];
        places.forEach(({ x, k, i }, n) => {
          const dx = u.valToPos(x, "x") + aside(k) / px() - u.cursor.left;
          const dy = (u.valToPos(panel.lines[k].mean[i], "y") - u.cursor.top) * 0.2;
          if (dx * dx + dy * dy < near) [best, near] = [n, dx * dx + dy * dy];
        });
        tell(best);
      }],
    },
  }, [xr, yr], host);
  tapping(u);
  stepping(host, places.length, tell);
  return u;
}
const shortened = (text) => (text.length > 14 ? `${text.slice(0, 6)}…${text.slice(-7)}` : text);
/** The indices of the names that fit beside each other under the plot: every one, every second one, and so on. */
function thinned(u, names) {
  const longest = Math.max(...names.map((name) => shortened(name).length));
  const every = Math.max(1, Math.ceil((names.length * (0.5 * longest + 1) * rem()) / (u.width || 400)));
  return names.map((_, i) => i).filter((i) => i % every === 0);
}
/** A touch moves the cursor as a mouse does. */
function tapping(u) {
  for (const kind of ["pointerdown", "pointermove"]) u.over.addEventListener(kind, (e) => {
    if (e.pointerType !== "touch") return;
    const box = u.over.getBoundingClientRect();
    u.setCursor({ left: e.clientX - box.left, top: e.clientY - box.top }, true, true);
  });
}

// ---- heat maps ----

const channels = (name) => style(name).match(/[0-9a-f]{2}/gi).map((h) => parseInt(h, 16));
/** The colour for a value between −1 and 1. */
function diverging(share) {
  const s = Math.max(-1, Math.min(1, share));
  const [zero, end] = [channels("zero"), channels(s < 0 ? "negative" : "positive")];
  return `rgb(${zero.map((z, i) => Math.round(z + (end[i] - z) * Math.abs(s))).join()})`;
}
function heatChart(host, data) {
  const note = host.parentElement.querySelector(".readout");
  const [xe, ye] = [data.x_edges, data.y_edges];
  const cells = data.cells.filter((c) => c.value != null);
  let told = -1;
  const box = (u, c) => {
    const [x0, x1] = [xe[c.x], xe[c.x + 1]].map((v) => Math.round(u.valToPos(v, "x", true)));
    const [y1, y0] = [ye[c.y], ye[c.y + 1]].map((v) => Math.round(u.valToPos(v, "y", true)));
    return [x0, y0, x1 - x0, y1 - y0];
  };
  const hatch = (ctx, [x, y, w, h]) => {
    ctx.save();
    ctx.beginPath();
    ctx.rect(x, y, w, h);
    ctx.clip();
    ctx.strokeStyle = style("paper");
    ctx.lineWidth = 2 * px();
    ctx.beginPath();
    for (let d = -h; d < w; d += 6 * px()) { ctx.moveTo(x + d, y + h); ctx.lineTo(x + d + h, y); }
    ctx.stroke();
    ctx.restore();
  };
  const draw = (u) => clipped(u, (ctx) => cells.forEach((c, n) => {
    const [x, y, w, h] = box(u, c);
    ctx.fillStyle = diverging(c.value / data.limit);
    ctx.fillRect(x, y, w - px(), h - px());
    if (!c.supported) hatch(ctx, [x, y, w, h]);
    if (n !== told) return;
    ctx.strokeStyle = style("ink");
    ctx.lineWidth = 2 * px();
    ctx.strokeRect(x + px(), y + px(), w - 3 * px(), h - 3 * px());
  }));
  // a label is a name with its unit in brackets, such as "Sideslip β (°)"
  const along = (label, from, to) => {
    const [, name, unit] = label.match(/^(.*?)(?: \(([^)]*)\))?$/);
    return `${name} ${span(from, to, unit)}`;
  };
  const tell = (n) => {
    if (n === told) return;
    told = n;
    u.redraw(false);
    const c = cells[n];
    note.textContent = !c ? "" :
      `${along(data.x_label, xe[c.x], xe[c.x + 1])}, ${along(data.y_label, ye[c.y], ye[c.y + 1])}: ${show(c.value)} ${data.unit}, ${counted(c.samples)}`;
  };
  const ends = (edges) => [edges[0] ?? 0, edges[edges.length - 1] ?? 1];
  const u = new uPlot({
    ...size(host), padding: [0.5 * rem(), rem(), 0, 0], legend: { show: false },
    cursor: { y: false, x: false, drag: { x: false, y: false }, points: { show: false } },
    scales: { x: { time: false, range: () => ends(xe) }, y: { range: () => ends(ye) } },
    axes: [
      axis({ size: 1.7 * rem(), values: showTicks, space: 2.6 * rem(), label: data.x_label, labelSize: 1.4 * rem(), labelGap: 0 }),
      sideAxis({ label: data.y_label, labelSize: 1.4 * rem(), labelGap: 0 }),
    ],
    series: [{}, { paths: () => null, points: { show: false } }],
    hooks: {
      draw: [draw],
      setCursor: [(u) => {
        const [x, y] = [u.posToVal(u.cursor.left, "x"), u.posToVal(u.cursor.top, "y")];
        tell(u.cursor.left < 0 ? -1 : cells.findIndex((c) => x >= xe[c.x] && x < xe[c.x + 1] && y >= ye[c.y] && y < ye[c.y + 1]));
      }],
    },
  }, [ends(xe), ends(ye)], host);
  tapping(u);
  stepping(host, cells.length, tell);
  return u;
}

// ---- curves on a logarithmic or linear axis ----

function curvesChart(host, data) {
  const height = (v) => (v != null && (data.linear || v > 0) ? v : null);
  const values = data.series.map((s) => s.values.map(height));
  const outputs = legend(host, data.series.map((s) => ({ label: s.label, style: s.style })), (i) => {
    u.setSeries(i + 1, { show: !u.series[i + 1].show });
    return u.series[i + 1].show;
  });
  const edges = data.ranges.flatMap((r) => [...r.low, ...r.high].map(height));
  const all = [...values.flat(), ...edges].filter((v) => v != null);
  const [low, high] = all.length ? [Math.min(...all), Math.max(...all)] : [0.1, 1];
  const yr = data.linear ? padded(low, high) : [low / 1.4, Math.max(high * 1.4, low * 4)];
  const drawRange = (ctx, u, { of, low, high }) => {
    ctx.fillStyle = style(data.series[of].style);
    ctx.globalAlpha = 0.16;
    let run = [];
    const close = () => {
      ctx.beginPath();
      for (const i of run) ctx.lineTo(u.valToPos(data.x[i], "x", true), u.valToPos(high[i], "y", true));
      for (const i of run.reverse()) ctx.lineTo(u.valToPos(data.x[i], "x", true), u.valToPos(low[i], "y", true));
      ctx.fill();
      run = [];
    };
    data.x.forEach((x, i) => (height(low[i]) == null || height(high[i]) == null ? close() : run.push(i)));
    close();
    ctx.globalAlpha = 1;
  };
  const tell = (k) => data.series.forEach((s, i) => {
    outputs[i].textContent = k == null || k < 0 ? "" : show(s.values[k]) || "no data";
  });
  const u = new uPlot({
    ...size(host), padding: [0.5 * rem(), rem(), 0, 0], legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false }, points: { size: 6 } },
    scales: { x: { time: false, range: (u, a, b) => [Math.min(0, a), b] }, y: { ...(data.linear ? {} : { distr: 3, log: 10 }), range: () => yr } },
    axes: [
      axis({ size: 1.7 * rem(), values: showTicks, space: 3.5 * rem(), label: data.x_label, labelSize: 1.4 * rem(), labelGap: 0 }),
      sideAxis(data.linear ? { label: data.y_label, labelSize: 1.4 * rem(), labelGap: 0 } : { splits: decadesFine, values: (u, s) => s.map((v) => (v == null ? "" : v < 0.001 ? signed(v.toExponential(0)) : showChosen(v))), filter: (u, s) => s, label: data.y_label, labelSize: 1.4 * rem(), labelGap: 0 }),
    ],
    series: [{}, ...data.series.map((s) => ({
      label: s.label, stroke: style(s.style), dash: DASH[s.style], width: Math.max(2, 0.12 * rem()),
      points: { show: data.x.length < 40, size: 5, fill: style(s.style) }, pxAlign: 0,
    }))],
    hooks: {
      drawAxes: [(u) => clipped(u, (ctx) => data.ranges.filter((r) => u.series[r.of + 1].show).forEach((r) => drawRange(ctx, u, r)))],
      setCursor: [(u) => tell(u.cursor.left >= 0 ? u.cursor.idx : null)],
    },
  }, [data.x, ...values], host);
  tapping(u);
  stepping(host, data.x.length, (i) => {
    tell(i);
    u.setCursor({ left: i < 0 ? -10 : u.valToPos(data.x[i], "x"), top: i < 0 ? -10 : u.over.clientHeight / 2 }, false);
  });
  return u;
}

// ---- choices ----

const choices = [...document.querySelectorAll(".choice")];
const hidden = (host) => host.closest(".option[hidden]") != null;
/** Shows `option` in every choice called `label` that has this option. */
function choose(label, option) {
  for (const box of choices.filter((c) => c.dataset.label === label)) {
    const own = [...box.children].filter((o) => o.className === "option");
    if (!own.some((o) => o.dataset.option === option)) continue;
    for (const o of own) o.hidden = o.dataset.option !== option;
    for (const b of box.querySelectorAll(":scope > .options button"))
      b.setAttribute("aria-pressed", String(b.dataset.option === option));
  }
}
for (const box of choices) {
  const first = box.querySelector(".option");
  if (first) choose(box.dataset.label, first.dataset.option);
  for (const b of box.querySelectorAll(":scope > .options button"))
    b.onclick = () => { choose(box.dataset.label, b.dataset.option); build(); };
}
for (const link of document.querySelectorAll("a.show")) link.onclick = (e) => {
  const box = document.getElementById(link.getAttribute("href").slice(1));
  if (!box) return;
  e.preventDefault();
  choose(box.dataset.label, link.dataset.option);
  build();
  (box.closest("section") ?? box).scrollIntoView({ block: "start" });
};
