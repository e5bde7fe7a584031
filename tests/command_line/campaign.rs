//! `greylag campaign`: cells that are killed go on to the same bits, what is missing or stale is named.

use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use tempfile::TempDir;

/// Flights and flown targets: seconds of work without the feature `learn`.
const FLOWN: &str = r#"
schema = 1
name = "flown"
seeds = [1, 2]

[axes]
controller = ["pid", "policy"]

[[stage]]
name = "flights"
over = ["seed"]
command = "collect --episodes 4 --seed {seed} --out {out}"
core_seconds = 3

[[stage]]
name = "scores"
over = ["controller", "seed"]
command = """evaluate --controller {controller} --model params/x8/jsbsim.toml --policy params/x8/policy
  --targets TARGETS --seed {seed} --json {out}/evaluation.json --force"""
core_seconds = 5

[[table]]
title = "Scores"
stage = "scores"
rows = ["controller"]
metrics = ["all.mean_deg"]

[[claim]]
says = "The policy is better than the PID"
metric = "all.mean_deg"
less = "scores controller=policy"
than = "scores controller=pid"
"#;

/// A campaign file in a folder of its own.
struct Campaign {
    folder: TempDir,
}

impl Campaign {
    fn new(text: &str) -> Campaign {
        let folder = tempfile::tempdir().unwrap();
        let targets = folder.path().join("targets.csv");
        fs::write(&targets, "group,roll_deg,pitch_deg\neasy,10,5\nhard_corners,50,27\n").unwrap();
        let campaign = Campaign { folder };
        campaign.write(&text.replace("TARGETS", targets.to_str().unwrap()));
        campaign
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, text: &str) {
        fs::write(self.path("campaign.toml"), text).unwrap();
    }

    /// `greylag campaign WHAT … --out OUT …`.
    fn command(&self, what: &str, out: &str, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_greylag"));
        command.args(["campaign", what]).arg(self.path("campaign.toml"));
        command.arg("--out").arg(self.path(out)).args(more);
        command
    }

    fn run(&self, what: &str, out: &str, more: &[&str]) -> Output {
        self.command(what, out, more).output().unwrap()
    }

    /// The results that are joined from a folder.
    fn gathered(&self, out: &str) -> String {
        let path = self.path(&format!("{out}.jsonl"));
        let joined = self.run("gather", out, &["--results", path.to_str().unwrap(), "--force"]);
        assert_eq!(joined.status.code(), Some(0), "{}", said(&joined));
        fs::read_to_string(path).unwrap()
    }

    /// Begins a run of all cells and kills it with all its processes after each of `after` ms; then lets one end.
    fn run_with_kills(&self, out: &str, after: &[u64]) {
        for ms in after {
            let mut begun = self.command("run", out, &["--local", "--jobs", "1"]);
            let mut child = begun.process_group(0).spawn().unwrap();
            std::thread::sleep(Duration::from_millis(*ms));
            // SAFETY: a signal to the group that was made above
            unsafe { libc::kill(-child.id().cast_signed(), libc::SIGKILL) };
            child.wait().unwrap();
        }
        let ended = self.run("run", out, &["--local", "--jobs", "2"]);
        assert!(ended.status.success(), "{}", said(&ended));
    }
}

fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    text(&output.stdout) + &text(&output.stderr)
}

#[test]
fn a_campaign_that_is_killed_goes_on_to_the_same_bits() {
    let campaign = Campaign::new(FLOWN);
    let plain = campaign.run("run", "plain", &["--local", "--jobs", "1"]);
    assert!(plain.status.success(), "{}", said(&plain));
    campaign.run_with_kills("killed", &[60, 150, 300, 600]);
    assert_eq!(campaign.gathered("plain"), campaign.gathered("killed"));
    // what is done is not done again
    let begun = std::time::Instant::now();
    let again = campaign.run("run", "plain", &["--cell", "1"]);
    assert!(said(&again).contains("done before") && again.status.success(), "{}", said(&again));
    assert!(begun.elapsed() < Duration::from_secs(20));

    let page = campaign.path("page.html");
    let report = campaign.run("report", "plain", &["--report", page.to_str().unwrap()]);
    assert!(report.status.success(), "{}", said(&report));
    assert!(said(&report).contains("The policy is better than the PID: **"), "{}", said(&report));
    let page = fs::read_to_string(page).unwrap();
    for part in ["href=\"#numbers-0-0\"", "href=\"#cell-scores-pid-1\"", "id=\"cell-scores-pid-1\""]
    {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn what_is_missing_failed_or_stale_is_named_and_not_mixed_in() {
    let campaign = Campaign::new(FLOWN);
    let one = campaign.run("run", "out", &["--cell", "scores/pid/1"]);
    assert!(one.status.success(), "{}", said(&one));
    let joined = campaign.run("gather", "out", &[]);
    assert_eq!(joined.status.code(), Some(3), "{}", said(&joined));
    for part in ["1 of 6 cells are done", "missing: flights/2", "missing: scores/policy/2"] {
        assert!(said(&joined).contains(part), "{part}: {}", said(&joined));
    }
    assert!(!said(&joined).contains("scores/pid/1"), "{}", said(&joined));

    // another target: the result is of another input
    let targets = campaign.path("targets.csv");
    fs::write(targets, "group,roll_deg,pitch_deg\neasy,-10,5\nhard_corners,50,27\n").unwrap();
    let joined = campaign.run("gather", "out", &[]);
    assert!(said(&joined).contains("0 of 6 cells are done"), "{}", said(&joined));
    assert!(said(&joined).contains("has changed since: scores/pid/1"), "{}", said(&joined));
}

#[test]
fn two_cells_of_one_command_are_two_results_in_a_report() {
    let named = r#"[{ name = "one", words = "pid" }, { name = "two", words = "pid" }]"#;
    let text = FLOWN.replace(r#"["pid", "policy"]"#, named);
    let text = text.replace("controller=policy", "controller=one");
    let campaign = Campaign::new(&text.replace("controller=pid", "controller=two"));
    let mut results = String::new();
    for cell in ["scores/one/1", "scores/two/1"] {
        let run = campaign.run("run", "out", &["--cell", cell]);
        assert!(run.status.success(), "{}", said(&run));
        let folder = folder_of(&campaign.path("out"), &cell.replace('/', "-"));
        results += &fs::read_to_string(folder.join("result.json")).unwrap();
    }
    let path = campaign.path("results.jsonl");
    fs::write(&path, results).unwrap();
    let report = campaign.run("report", "out", &["--results", path.to_str().unwrap()]);
    assert!(said(&report).contains("4 of 6 cells are missing"), "{}", said(&report));
    assert!(!said(&report).contains("stale"), "{}", said(&report));
}

#[test]
fn the_status_of_a_cell_says_whether_to_try_again() {
    let reads = "[[stage]]\nname = \"reads\"\nover = [\"seed\"]\n\
                 command = \"evaluate --controller policy --policy {flights} --json {out}/e.json\"\n";
    let campaign = Campaign::new(&FLOWN.replace("[[table]]", &format!("{reads}\n[[table]]")));
    let status = |cell: &str| {
        let output = campaign.run("run", "out", &["--cell", cell]);
        (output.status.code(), said(&output))
    };
    // nothing that it reads is there yet
    let (code, text) = status("reads/1");
    assert!(code == Some(75) && text.contains("waits for cell flights/1"), "{code:?} {text}");
    // another process runs it
    let lock = fs::read_dir(campaign.path("out")).ok().map(|_| ());
    assert!(lock.is_none(), "a cell that waits leaves nothing");
    assert_eq!(status("flights/1").0, Some(0));
    let folder = folder_of(&campaign.path("out"), "flights-1-");
    fs::remove_file(folder.join("result.json")).unwrap();
    let held = fs::File::create(folder.join("lock")).unwrap();
    held.lock().unwrap();
    let (code, text) = status("flights/1");
    assert!(code == Some(75) && text.contains("another process"), "{code:?} {text}");
    drop(held);
    assert_eq!(status("flights/1").0, Some(0));
    // flights are no policy, whenever that is tried
    let (code, text) = status("reads/1");
    assert_eq!(code, Some(1), "{text}");
    let joined = campaign.run("gather", "out", &[]);
    assert!(said(&joined).contains("failed: reads/1: "), "{}", said(&joined));
    // a run leaves it, and says so
    assert_eq!(status("17").0, Some(1));
}

fn folder_of(out: &Path, start: &str) -> PathBuf {
    let name = |e: &fs::DirEntry| e.file_name().to_string_lossy().starts_with(start);
    fs::read_dir(out).unwrap().flatten().find(name).unwrap().path()
}

/// Core-hours are said before anything is run, and twice the seeds cost twice as much.
#[test]
fn the_cost_is_linear_in_the_cells() {
    let hours = |seeds: &str| {
        let campaign = Campaign::new(&FLOWN.replace("[1, 2]", seeds));
        let plan = said(&campaign.run("plan", "out", &[]));
        let line = plan.lines().find(|l| l.contains("core-hours left:")).unwrap().to_owned();
        line.split([' ', ',']).nth(3).unwrap().parse::<f64>().unwrap()
    };
    // 2 · 3 s and 4 · 5 s; three decimals of an hour are printed
    let two = hours("[1, 2]");
    assert!((two - 26.0 / 3600.0).abs() < 6e-4, "{two}");
    assert!((hours("[1, 2, 3, 4, 5, 6, 7, 8]") - 4.0 * 26.0 / 3600.0).abs() < 6e-4);
}

#[test]
fn a_campaign_file_that_cannot_be_run_is_refused_in_words() {
    for (from, to, why) in [
        ("schema = 1", "schema = 7", "schema 7: this program reads schema 1"),
        ("core_seconds = 3", "core_second = 3", "line 13: unknown field `core_second`"),
        ("seeds = [1, 2]", "seeds = [1, 1]", "seed 1 is there twice"),
        (
            "over = [\"controller\", \"seed\"]",
            "over = [\"pilot\", \"seed\"]",
            "there is no axis pilot; there are controller, seed",
        ),
        (
            "--seed {seed} --out",
            "--seed {sed} --out",
            "{sed} is no axis of this stage and no stage before it",
        ),
        ("params/x8/jsbsim.toml", "params/x8/jsbsom.toml", "cannot read params/x8/jsbsom.toml"),
        ("collect --episodes 4", "collect --episodse 4", "unexpected argument '--episodse'"),
        ("command = \"collect", "command = \"fly", "command \"fly\" cannot be a cell"),
        (
            "controller=pid",
            "controller=pud",
            "axis controller has no level pud; it has pid, policy",
        ),
        (
            "stage = \"scores\"",
            "stage = \"score\"",
            "there is no stage score; there are flights, scores",
        ),
    ] {
        let text = FLOWN.replacen(from, to, 1);
        assert_ne!(text, FLOWN, "{from}");
        let campaign = Campaign::new(&text);
        let plan = campaign.run("plan", "out", &[]);
        assert_eq!(plan.status.code(), Some(1), "{to}: {}", said(&plan));
        assert!(
            said(&plan).contains(why) && said(&plan).contains("campaign.toml"),
            "{to}: {}",
            said(&plan)
        );
    }
}

/// The shipped campaigns can be planned as they are.
#[test]
fn the_shipped_campaigns_are_whole() {
    for (name, cells) in [("small", 90), ("paper", 1150)] {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("params/campaigns/{name}.toml"));
        let command = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args(["campaign", "plan"])
            .arg(file)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(command.status.success(), "{}", said(&command));
        assert!(said(&command).contains(&format!("{cells} cells, ")), "{}", said(&command));
    }
}

/// Models and policies too: a training that is killed goes on from its checkpoint to the same files.
#[cfg(feature = "learn")]
#[test]
fn trainings_that_are_killed_go_on_to_the_same_bits() {
    let trained = r#"
schema = 1
name = "trained"
seeds = [1]

[[stage]]
name = "flights"
over = ["seed"]
command = "collect --episodes 10 --seed {seed} --out {out}"

[[stage]]
name = "dynamics"
over = ["seed"]
command = """train dynamics --prior params/x8/prior-mild.toml --trainable roll_linear.Clda --collect {flights}
  --integrator jsbsim --hidden 8 --steps 4 --batch 8 --updates 4500 --seed {seed} --out {out}"""

[[stage]]
name = "policies"
over = ["seed"]
command = """train policy --env model:{dynamics} --actor 8 --critic 8 --batch 16 --steps 3000 --warmup 500 --evaluate 500
  --checkpoint 1000 --seed {seed} --out {out}"""
"#;
    let campaign = Campaign::new(trained);
    campaign.run_with_kills("plain", &[]);
    campaign.run_with_kills("killed", &[500, 1500, 1500, 2500]);
    let plain = campaign.gathered("plain");
    assert_eq!(plain, campaign.gathered("killed"));
    for part in ["residual.safetensors", "actor.safetensors", "after_100.nrmse", "\"curve\":{"] {
        assert!(plain.contains(part), "{part}");
    }
}
