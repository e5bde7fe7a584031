"""Mutation testing: which changes of the pilot, the vehicle link and the client link does no test notice?

All mutants stand in one program, each behind a switch at run time (schemata.py), so that the crate is built once and
not once a mutant. README.md says how it is used.
"""

import argparse
import collections
import datetime
import fcntl
import hashlib
import json
import math
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from schemata import Schemata, blamed

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent

# What is mutated: files, folders, or places of a file.
TARGETS = [
    ("src/flight/pilot", None),
    ("src/link/client.rs", None),
    ("src/link/client", None),
    ("src/link/vehicle.rs", None),
    ("src/link/vehicle", None),
    ("src/physics/airframe.rs", ["impl Envelope"]),
    ("src/control/cem/rollout.rs", ["slewed"]),
]
# Programs of tests with their modules: none of them depends on the clock of the wall.
PROGRAMS = {
    "flight": ["pilot", "controllers", "monitor"],
    "link": ["client", "controllers", "mutation", "routing", "setpoints", "vehicle"],
    "physics": ["airframe_files"],
}
CARGO = ["--ignore-rust-version", "--no-default-features", "--features", "sitl"]
# A hang: so many times the processor time of the plain run, and some seconds. A test that waits uses no processor
# time: it is stopped after some time on the clock of the wall, long because the machine may be busy.
HANG_TIMES, HANG_S = 4, 2
WAITS_TIMES, WAITS_S = 20, 60
# Tests up to this time run together in one process, up to this time in all, s: what tests of a program share, such as
# the design of a controller, is made once for them.
TOGETHER_S, GROUP_S = 1.2, 6.0
# A mutant may not fill the memory, bytes.
MEMORY = 6 << 30
CAUGHT = ("caught", "timeout")

RUNTIME = """//! The switch of the mutants: one of them is on, or none, or what is reached is written down.

use std::fs::File;
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

const UNKNOWN: u32 = u32::MAX;
const COVER: u32 = u32::MAX - 1;
static STATE: AtomicU32 = AtomicU32::new(UNKNOWN);
static SEEN: [AtomicBool; COUNT] = [const { AtomicBool::new(false) }; COUNT];

/// The place of the chosen mutant among `numbers`, from 1; 0 if it is none of them.
#[inline]
pub fn pick(numbers: &[u32]) -> usize {
    match STATE.load(Relaxed) {
        0 => 0,
        UNKNOWN | COVER => look(numbers),
        chosen => numbers.iter().position(|n| *n == chosen).map_or(0, |at| at + 1),
    }
}

/// Whether mutant `number` is chosen.
#[inline]
pub fn on(number: u32) -> bool {
    pick(&[number]) == 1
}

fn cover() -> Option<&'static File> {
    static FILE: OnceLock<Option<File>> = OnceLock::new();
    FILE.get_or_init(|| {
        let path = std::env::var_os("GREYLAG_MUTANTS_REACHED")?;
        File::options().create(true).append(true).open(path).ok()
    })
    .as_ref()
}

#[cold]
fn look(numbers: &[u32]) -> usize {
    if STATE.load(Relaxed) == UNKNOWN {
        let chosen = std::env::var("GREYLAG_MUTANT").ok().and_then(|n| n.parse().ok());
        STATE.store(if cover().is_some() { COVER } else { chosen.unwrap_or(0) }, Relaxed);
        return pick(numbers);
    }
    for n in numbers {
        if !SEEN[*n as usize].swap(true, Relaxed) {
            let _ = cover().map(|mut file| file.write_all(format!("{n}\\n").as_bytes()));
        }
    }
    0
}
"""


# --- the private copy of the sources ---


def files():
    """The files of the repository, without what git ignores."""
    out = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT, capture_output=True, check=True
    ).stdout.decode()
    return [f for f in out.split("\0") if f and (ROOT / f).is_file()]


def put(path, data):
    """Writes a file if it differs, so that cargo builds no more than it must."""
    if not path.is_file() or path.read_bytes() != data:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def targets(all_files):
    """The files to mutate, with the places in them."""
    for target, only in TARGETS:
        for file in sorted(f for f in all_files if f == target or f.startswith(target + "/")):
            if file.endswith(".rs"):
                yield file, only


def mutated(every, dropped):
    """The mutants of the files, and the text of each file with all of them in it but the dropped ones."""
    schemata = Schemata(dropped)
    texts = {file: schemata.rewrite(file, (ROOT / file).read_text(), only) for file, only in targets(every)}
    return schemata.mutants, texts


def write_tree(tree, dropped):
    """Copies the repository to `tree` with all mutants in it."""
    every = files()
    mutants, texts = mutated(every, dropped)
    texts["src/mutants.rs"] = RUNTIME.replace("COUNT", str(len(mutants) + 1))
    allowed = "#![allow(overflowing_literals, unconditional_panic, arithmetic_overflow, missing_docs, unused)]\n"
    library = (ROOT / "src/lib.rs").read_text().split("\npub mod num;", 1)
    texts["src/lib.rs"] = f"{library[0]}\n{allowed}pub mod mutants;\npub mod num;{library[1]}"
    for file in every:
        if file not in texts:
            put(tree / file, (ROOT / file).read_bytes())
    for file, text in texts.items():
        put(tree / file, text.encode())


# --- the build ---


class Cargo:
    """Cargo in the private copy, one at a time where other builds share the machine."""

    def __init__(self, options):
        self.tree, self.lock = options.work / "tree", options.lock
        self.target = os.environ.get("CARGO_TARGET_DIR", str(options.work / "target"))

    def run(self, *arguments):
        """What cargo reports, message by message, and whether it succeeded."""
        command = ["cargo", *arguments, *CARGO, "--message-format", "json"]
        if self.lock:
            command = ["flock", self.lock, *command]
        env = dict(os.environ, CARGO_TARGET_DIR=self.target, CARGO_INCREMENTAL="0")
        done = subprocess.run(command, cwd=self.tree, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        messages = [json.loads(line) for line in done.stdout.decode().splitlines() if line.startswith("{")]
        if done.returncode and not any(m["reason"] == "compiler-message" for m in messages):
            sys.exit(done.stderr.decode()[-3000:])
        return messages, done.returncode == 0


def errors_by_file(messages):
    """The compiler's errors: for each file, a list of their spans."""
    found = collections.defaultdict(list)
    for message in messages:
        report = message.get("message")
        if message["reason"] != "compiler-message" or report["level"] != "error" or not report["spans"]:
            continue
        spans = list(report["spans"])
        for child in report["children"]:
            spans += child["spans"]
        by_file = collections.defaultdict(list)
        for span in spans:
            by_file[span["file_name"]].append((span["byte_start"], span["byte_end"], span["is_primary"]))
        primary = [s["file_name"] for s in report["spans"] if s["is_primary"]][0]
        found[primary].append((by_file[primary], report["rendered"]))
    return found


def drop_what_does_not_build(cargo, options):
    """Leaves out mutants until the library builds; the mutants and the numbers of those left out."""
    dropped_file = options.work / "dropped.json"
    # Numbers of an earlier build hold for the same sources only.
    dropped = set()
    mutants, _ = mutated(files(), dropped)
    print(f"{len(mutants)} mutants", flush=True)
    key = hashlib.sha256("\n".join(m.name for m in mutants).encode()).hexdigest()
    if dropped_file.is_file() and (old := json.loads(dropped_file.read_text()))["key"] == key:
        dropped = set(old["dropped"])
    while True:
        write_tree(cargo.tree, dropped)
        started = time.monotonic()
        messages, good = cargo.run("build", "--lib")
        if good:
            return mutants, dropped
        fresh = set()
        for file, errors in errors_by_file(messages).items():
            numbers, lost = blamed((cargo.tree / file).read_bytes(), [spans for spans, _ in errors])
            fresh |= numbers
            for spans in lost:
                print("not of a mutant:", [text for s, text in errors if s is spans][0], flush=True)
        print(f"{time.monotonic() - started:.0f} s: {len(fresh)} more mutants do not build", flush=True)
        if not fresh - dropped:
            sys.exit("the library does not build, and no mutant is to blame: see the errors above")
        dropped |= fresh
        dropped_file.write_text(json.dumps({"key": key, "dropped": sorted(dropped)}))


def build(options):
    """Builds the library and its tests with all mutants, and notes the programs."""
    cargo = Cargo(options)
    mutants, dropped = drop_what_does_not_build(cargo, options)
    programs = [argument for name in PROGRAMS for argument in ("--test", name)]
    messages, good = cargo.run("test", "--no-run", "--lib", *programs)
    if not good:
        sys.exit("".join(m["message"]["rendered"] for m in messages if m["reason"] == "compiler-message"))
    found = {}
    for message in messages:
        if message["reason"] == "compiler-artifact" and message.get("executable") and message["profile"]["test"]:
            target = message["target"]
            found["lib" if "lib" in target["kind"] else target["name"]] = message["executable"]
    built = {"mutants": [vars(m) for m in mutants], "dropped": sorted(dropped), "programs": found}
    (options.work / "built.json").write_text(json.dumps(built))
    print(f"built: {len(mutants)} mutants, {len(dropped)} of which do not build; {len(found)} programs of tests", flush=True)


# --- running tests ---


def limits(seconds):
    """A session of its own, with bounded memory and processor time."""

    def set_limits():
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    return set_limits


def processor_time():
    """What the processes that have ended took, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run_tests(program, names, tree, limit_s, wait_s, **env):
    """Runs tests of a program: 'passed', 'caught' or 'timeout', the test that failed, the processor time it took."""
    before = processor_time()
    command = [program, "--exact", *names, "--test-threads", "1"]
    env = dict(os.environ, RUST_BACKTRACE="0", CARGO_MANIFEST_DIR=str(tree), **env)
    child = subprocess.Popen(
        command, cwd=tree, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        preexec_fn=limits(math.ceil(limit_s)),
    )
    try:
        out, _ = child.communicate(timeout=wait_s)
        over = child.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
        outcome = "timeout" if over else "caught" if child.returncode else "passed"
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        out, _ = child.communicate()
        outcome = "timeout"
    out = out.decode(errors="replace")
    failed = re.search(r"^test (\S+)(?: - should panic)? \.\.\. FAILED", out, re.M)
    passed = re.findall(r"^test (\S+)(?: - should panic)? \.\.\. ok", out, re.M)
    if outcome == "passed" and not passed:
        outcome = "nothing"
    left = [n for n in names if n not in passed]
    which = failed[1] if failed else left[0] if left else names[0]
    return outcome, which, processor_time() - before


def digest(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def cover(options):
    """Runs each test of the program without a mutant on, and notes its time and what it reaches."""
    built = json.loads((options.work / "built.json").read_text())
    store = options.work / "cover.jsonl"
    known = {(r["digest"], r["test"]): r for r in lines(store) if not is_outdated(r, options)}
    tree, found = options.work / "tree", []
    for label, program in sorted(built["programs"].items()):
        of = digest(program)
        listed = subprocess.run([program, "--list", "--format", "terse"], cwd=tree, capture_output=True, check=True)
        for name in re.findall(r"^(.*): test$", listed.stdout.decode(), re.M):
            test = f"{label} {name}"
            modules = PROGRAMS.get(label)
            if modules and name.split("::")[0] not in modules or not re.search(options.tests, test):
                continue
            record = known.get((of, test))
            if record is None:
                record = cover_one(options, program, name) | {"digest": of, "test": test}
                append(store, record)
                print(f"{record['outcome']:8} {record['seconds']:6.2f} s {len(record['reached']):5} reached  {test}", flush=True)
            found.append(record | {"program": program, "name": name})
    good = [r for r in found if r["outcome"] == "passed"]
    print(f"{len(found)} tests, {len(good)} pass within {options.longest} s, "
          f"{sum(bool(r['reached']) for r in good)} reach a mutant", flush=True)
    return [r for r in good if r["reached"]]


def is_outdated(record, options):
    """Whether a test was stopped that may run longer now."""
    return record["outcome"] == "timeout" and record["seconds"] < 0.9 * options.longest


def cover_one(options, program, name):
    """One test without a mutant on."""
    reached = options.work / "reached"
    reached.unlink(missing_ok=True)
    outcome, _, seconds = run_tests(
        program, [name], options.work / "tree", options.longest, 20 * options.longest, GREYLAG_MUTANTS_REACHED=str(reached)
    )
    numbers = sorted({int(n) for n in reached.read_text().split()}) if reached.is_file() else []
    return {"outcome": outcome, "seconds": round(seconds, 3), "reached": numbers}


def groups(tests):
    """The tests in the order in which they are run: quick ones of one program together."""
    tests = sorted(tests, key=lambda t: t["seconds"])
    quick = collections.defaultdict(list)
    out = []
    for test in tests:
        if test["seconds"] > TOGETHER_S:
            out.append([test])
            continue
        last = quick[test["program"]]
        if not last or sum(t["seconds"] for t in last[-1]) + test["seconds"] > GROUP_S:
            last.append([])
            out.append(last[-1])
        last[-1].append(test)
    return sorted(out, key=lambda group: sum(t["seconds"] for t in group))


def judge(mutant, tests, tree):
    """Runs a mutant against the tests that reach it, until one fails."""
    started = time.monotonic()
    outcome, by, count = ("missed", None, len(tests)) if tests else ("not reached", None, 0)
    for group in groups(tests):
        plain = sum(t["seconds"] for t in group)
        result, which, _ = run_tests(
            group[0]["program"], [t["name"] for t in group], tree,
            HANG_TIMES * plain + HANG_S, WAITS_TIMES * plain + WAITS_S, GREYLAG_MUTANT=str(mutant["number"]),
        )
        if result != "passed":
            outcome = "caught" if result == "nothing" else result
            label = group[0]["test"].split(" ")[0]
            by = f"{label} {which}"
            break
    return {"outcome": outcome, "by": by, "tests": count, "seconds": round(time.monotonic() - started, 2)}


# --- results ---


def lines(path):
    """The records of a JSON-lines file; a last line that was cut off counts for nothing."""
    if not path.is_file():
        return []
    out = []
    for line in path.read_text().splitlines():
        try:
            out.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return out


def append(path, record):
    """Adds one line, whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = not path.is_file() or path.read_bytes()[-1:] in (b"\n", b"")
    with open(path, "ab", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write((("" if fresh else "\n") + json.dumps(record, ensure_ascii=False) + "\n").encode())


def shown(mutant):
    """What the results say of a mutant."""
    keep = ("file", "line", "column", "function", "kind", "change", "code")
    return {key: mutant[key] for key in keep}


def identity(record):
    """What a mutant is known by when lines above it come or go."""
    return (record["file"], record["function"], record["code"], record["column"], record["change"])


def latest(path):
    """The last record of each mutant."""
    return {identity(r): r for r in lines(path)}


def chosen(options, built):
    """The mutants to run, in random order."""
    mutants = sorted(built["mutants"], key=lambda m: m["number"])
    random.Random(options.seed).shuffle(mutants)
    if options.sample:
        mutants = mutants[: options.sample]
    done = latest(options.results)
    for mutant in mutants:
        name = f"{mutant['file']}:{mutant['line']}: {mutant['change']} in {mutant['function']}"
        record = done.get(identity(mutant))
        missed = record is not None and record["outcome"] in ("missed", "not reached")
        if (missed if options.again else record is None) and re.search(options.only, name):
            yield mutant


def run(options):
    """Runs the mutants that have no result yet, each against the tests that reach it."""
    built = json.loads((options.work / "built.json").read_text())
    tests = cover(options)
    dropped = set(built["dropped"])
    reaching = collections.defaultdict(list)
    for test in tests:
        for number in test["reached"]:
            reaching[number].append(test)
    todo = list(chosen(options, built))
    counts, started = collections.Counter(), time.monotonic()
    for i, mutant in enumerate(todo, 1):
        if options.until and datetime.datetime.now().strftime("%H:%M") >= options.until:
            print("the time is over", flush=True)
            break
        if mutant["number"] in dropped:
            result = {"outcome": "does not build", "by": None, "tests": 0, "seconds": 0.0}
        else:
            result = judge(mutant, reaching[mutant["number"]], options.work / "tree")
        append(options.results, shown(mutant) | result)
        counts[result["outcome"]] += 1
        if i % 20 == 0 or i == len(todo):
            pace = (time.monotonic() - started) / i
            print(f"{i} of {len(todo)}, {pace:.2f} s each, {pace * (len(todo) - i) / 60:.0f} min left: {dict(counts)}", flush=True)


def wilson(part, whole, z=1.96):
    """The 95 % interval of a share."""
    if not whole:
        return 0.0, 1.0
    share, square = part / whole, z * z / whole
    middle = (share + square / 2) / (1 + square)
    reach = z * math.sqrt(share * (1 - share) / whole + square / whole / 4) / (1 + square)
    return middle - reach, middle + reach


def of_today():
    """The mutants of the sources as they are, built or not."""
    return {identity(vars(mutant)): vars(mutant) for mutant in mutated(files(), set())[0]}


def report(options):
    """Prints the mutation score, by file and in all, then what was missed; code that is no more counts for nothing."""
    equivalent = {(e["file"], e["function"], e["change"], e["code"]) for e in lines(HERE / "equivalent.jsonl")}
    today = of_today()
    records = [r | {"line": today[i]["line"]} for i, r in latest(options.results).items() if i in today]
    print(f"{len(records)} of {len(today)} mutants were run")
    for record in records:
        key = (record["file"], record["function"], record["change"], record["code"])
        if key in equivalent and record["outcome"] not in CAUGHT:
            record["outcome"] = "equivalent"
    outcomes = ["caught", "timeout", "missed", "not reached", "equivalent", "does not build"]
    table = collections.defaultdict(collections.Counter)
    for record in records:
        table[record["file"]][record["outcome"]] += 1
        table["all"][record["outcome"]] += 1
    print(f"{'file':44}" + "".join(f"{o:>15}" for o in outcomes) + "   score")
    for file in sorted(table, key=lambda f: (f == "all", f)):
        row = table[file]
        part, whole = row["caught"] + row["timeout"], sum(row[o] for o in outcomes[:4])
        low, high = wilson(part, whole)
        score = f"{100 * part / whole:6.1f} % ({100 * low:.1f} to {100 * high:.1f})" if whole else ""
        print(f"{file:44}" + "".join(f"{row[o]:15}" for o in outcomes) + f"  {score}")
    for record in sorted(records, key=lambda r: (r["file"], r["line"], r["column"])):
        if record["outcome"] in ("missed", "not reached"):
            print(f"{record['outcome']:11} {record['file']}:{record['line']}: {record['change']} in {record['function']}"
                  f"   | {record['code']}")


def everything(options):
    build(options)
    run(options)


def main():
    commands = {"all": everything, "build": build, "cover": cover, "run": run, "report": report}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", choices=commands)
    parser.add_argument("--work", type=Path, default=ROOT / "target/mutants", help="folder of the copy and its build")
    parser.add_argument("--results", type=Path, default=ROOT / "results/mutants.jsonl", help="JSON lines, added to")
    parser.add_argument("--sample", type=int, help="only so many mutants, drawn at random")
    parser.add_argument("--seed", type=int, default=1, help="of the order in which mutants are run")
    parser.add_argument("--only", default="", help="mutants whose name this regular expression finds")
    parser.add_argument("--again", action="store_true", help="run the missed mutants once more, and no others")
    parser.add_argument("--tests", default="", help="tests whose name this regular expression finds")
    parser.add_argument("--longest", type=float, default=10.0, help="tests that take more processor time are left out, s")
    parser.add_argument("--until", help="stop at this time of the day, HH:MM")
    parser.add_argument("--lock", help="a file to lock around each run of cargo")
    options = parser.parse_args()
    options.work = options.work.resolve()
    options.work.mkdir(parents=True, exist_ok=True)
    if shutil.which("cargo") is None:
        sys.exit("cargo is not there: install Rust")
    commands[options.command](options)


if __name__ == "__main__":
    main()
