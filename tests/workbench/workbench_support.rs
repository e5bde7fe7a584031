//! The program as a workbench, asked over real HTTP.
#![allow(dead_code, reason = "each test uses a part")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

pub const MODEL: &str = "params/x8/jsbsim.toml";
/// What any answer of the program may take here: other tests run beside this one on two cores.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// What is said of a failure.
pub fn word(value: &Value) -> &str {
    value["error"].as_str().unwrap_or_default()
}

/// The program with its address and token; it is killed when dropped, as by `kill -9`.
pub struct Bench {
    pub child: Child,
    pub host: String,
    pub token: String,
}

impl Bench {
    pub fn open(folder: &Path, more: &[&str]) -> Bench {
        let mut child = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args(["workbench", "--dir", folder.to_str().unwrap()])
            .args(more)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.split_whitespace().last().unwrap_or_default();
        let (host, token) =
            address.strip_prefix("http://").unwrap().split_once("/?token=").unwrap();
        Bench { child, host: host.into(), token: token.into() }
    }

    /// A request with these header lines; status, head and body of the answer.
    pub fn raw(
        &self,
        method: &str,
        path: &str,
        headers: &str,
        body: &[u8],
    ) -> (u16, String, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let length = body.len();
        let head = format!(
            "{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: {length}\r\n{headers}\r\n"
        );
        stream.write_all(head.as_bytes()).unwrap();
        // a request that is refused early is not read to its end
        let _ = stream.write_all(body);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|w| w == b"\r\n\r\n").expect("an answer with a head");
        let head = String::from_utf8_lossy(&answer[..end]).into_owned();
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        (status, head, answer[end + 4..].to_vec())
    }

    pub fn headers(&self) -> String {
        format!(
            "Host: {}\r\nAuthorization: Bearer {}\r\nContent-Type: application/json\r\n",
            self.host, self.token
        )
    }

    pub fn ask(&self, method: &str, path: &str, body: &[u8]) -> (u16, Value) {
        let (status, _, body) = self.raw(method, path, &self.headers(), body);
        (status, serde_json::from_slice(&body).unwrap_or(Value::Null))
    }

    pub fn get(&self, path: &str) -> (u16, Value) {
        self.ask("GET", path, b"")
    }

    pub fn state(&self) -> Value {
        self.get("/api/state").1
    }

    /// Asks for a change at the session's present revision.
    pub fn act(&self, act: Value) -> (u16, Value) {
        self.act_at(self.state()["revision"].as_u64().unwrap(), act)
    }

    pub fn act_at(&self, revision: u64, act: Value) -> (u16, Value) {
        let request = json!({ "revision": revision, "act": act });
        self.ask("POST", "/api/act", request.to_string().as_bytes())
    }

    pub fn drop_file(&self, name: &str, content: &[u8]) -> (u16, Value) {
        let revision = self.state()["revision"].as_u64().unwrap();
        self.ask("POST", &format!("/api/logs?name={name}&revision={revision}"), content)
    }

    /// Waits until the state is as wanted.
    pub fn until(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        self.until_of("/api/state", what, wanted)
    }

    /// Waits until what `path` answers is as wanted.
    pub fn until_of(&self, path: &str, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let state = self.get(path).1;
            if wanted(&state) {
                return state;
            }
            assert!(begun.elapsed() < PATIENCE, "{what}: {state}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
