//! `quadlab lab` as a process, and plain HTTP to it, also such as no browser would send.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use serde_json::Value;
use stories::program;

/// How long the server may take to read flights, to answer, to end.
const PATIENCE: Duration = Duration::from_secs(60);

/// The command that serves a folder on a port of the system's choice.
pub(crate) fn command(folder: &Path) -> Command {
    let mut command = Command::new(program("quadlab"));
    command.arg("lab").arg(folder).args(["--port", "0", "--no-open"]).stdin(Stdio::null());
    command
}

/// What a command prints that must end by itself.
pub(crate) fn output(mut command: Command) -> Output {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > PATIENCE {
            let _ = child.kill();
            panic!("{command:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().unwrap()
}

/// A server that runs; it ends with this value.
pub(crate) struct Lab {
    child: Child,
    /// What it says on standard error.
    said: PathBuf,
    /// With its token: for a browser.
    pub(crate) address: String,
    pub(crate) port: u16,
    pub(crate) token: String,
    _said_folder: tempfile::TempDir,
}

impl Lab {
    /// Serves a folder.
    pub(crate) fn start(folder: &Path) -> Self {
        Self::of(command(folder))
    }

    /// What a command serves.
    pub(crate) fn of(mut command: Command) -> Self {
        let said_folder = tempfile::tempdir().unwrap();
        let said = said_folder.path().join("stderr");
        let mut child = command.stdout(Stdio::piped()).stderr(File::create(&said).unwrap()).spawn().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let (sender, first_line) = mpsc::channel();
        // It may go on to say things, and must not find its output closed.
        std::thread::spawn(move || {
            let mut line = String::new();
            let _ = output.read_line(&mut line);
            let _ = sender.send(line);
            std::io::copy(&mut output, &mut std::io::sink())
        });
        let line = first_line.recv_timeout(PATIENCE).unwrap_or_default();
        let parts = line.find("http://").and_then(|start| {
            let address = line[start..].trim();
            let (port, token) = address.strip_prefix("http://127.0.0.1:")?.split_once("/?token=")?;
            Some((address.to_owned(), port.parse().ok()?, token.to_owned()))
        });
        let Some((address, port, token)) = parts else {
            let _ = child.kill();
            let _ = child.wait();
            panic!("no address in {line:?}; {}", fs::read_to_string(&said).unwrap_or_default());
        };
        Self { child, said, address, port, token, _said_folder: said_folder }
    }

    /// Ends it as a power cut would (SIGKILL).
    pub(crate) fn cut(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// A request as from the page, with its cookie and origin.
    pub(crate) fn visitor(&self) -> Visitor {
        let answer = Request::get(&format!("/?token={}", self.token)).send(self);
        let cookie = answer.header("set-cookie").expect("a cookie for the token");
        Visitor { cookie: cookie.split(';').next().unwrap().to_owned() }
    }

    /// What it shows once all flights are read and no job runs.
    pub(crate) fn state(&self) -> Value {
        let (visitor, start) = (self.visitor(), Instant::now());
        loop {
            let state = visitor.get("/api/state").send(self).json();
            if state["reading"] == false && state["job"].is_null() {
                return state;
            }
            assert!(start.elapsed() < PATIENCE, "the server does not come to rest: {}", state["job"]);
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Identifies a model, number 1.
    pub(crate) fn identify(&self) {
        self.state();
        let answer = self.visitor().post("/api/jobs", r#"{"do":"identify"}"#).with_origin(self).send(self);
        assert_eq!(answer.status, 200, "{}", answer.body);
        assert_eq!(self.state()["models"][0]["id"], 1);
    }

    /// Memory that it takes now, and the most it took, kB.
    pub(crate) fn memory_kb(&self) -> [u64; 2] {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        ["VmRSS:", "VmHWM:"].map(|name| {
            let line = status.lines().find_map(|line| line.strip_prefix(name)).expect("a figure of memory");
            line.trim().trim_end_matches(" kB").parse().unwrap()
        })
    }

    /// What it said, where it did not end well by itself.
    pub(crate) fn is_alive(&mut self) -> Result<(), String> {
        match self.child.try_wait().unwrap() {
            None => Ok(()),
            Some(status) => {
                Err(format!("ended with {status}: {}", fs::read_to_string(&self.said).unwrap_or_default()))
            }
        }
    }
}

impl Drop for Lab {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Who has shown the token.
pub(crate) struct Visitor {
    cookie: String,
}

impl Visitor {
    /// A request with the cookie.
    pub(crate) fn get(&self, path: &str) -> Request {
        Request::get(path).with("Cookie", &self.cookie)
    }

    /// A request with the cookie, to which an origin has to be added.
    pub(crate) fn post(&self, path: &str, body: &str) -> Request {
        Request::post(path, body).with("Cookie", &self.cookie)
    }
}

/// A request, byte by byte.
pub(crate) struct Request {
    method: &'static str,
    path: String,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Request {
    pub(crate) fn get(path: &str) -> Self {
        Self { method: "GET", path: path.to_owned(), headers: Vec::new(), body: Vec::new() }
    }

    pub(crate) fn post(path: &str, body: &str) -> Self {
        let request = Self {
            method: "POST",
            path: path.to_owned(),
            headers: Vec::new(),
            body: body.as_bytes().to_vec(),
        };
        request.with("Content-Type", "application/json").with("Content-Length", &body.len().to_string())
    }

    /// With a header, in place of one of the same name.
    pub(crate) fn with(mut self, name: &str, value: &str) -> Self {
        self.headers.retain(|(known, _)| !known.eq_ignore_ascii_case(name));
        self.headers.push((name.to_owned(), value.to_owned()));
        self
    }

    /// With the origin of the page itself.
    pub(crate) fn with_origin(self, lab: &Lab) -> Self {
        self.with("Origin", &format!("http://127.0.0.1:{}", lab.port))
    }

    pub(crate) fn send(self, lab: &Lab) -> Answer {
        let what = format!("{} {}", self.method, self.path);
        let mut stream = self.put(lab);
        let mut bytes = Vec::new();
        let read = stream.read_to_end(&mut bytes);
        Answer::parse(&bytes).unwrap_or_else(|| panic!("{what}: no answer ({read:?})"))
    }

    /// Sends it and goes away without waiting for the answer.
    pub(crate) fn send_and_leave(self, lab: &Lab) {
        self.put(lab).shutdown(Shutdown::Both).unwrap();
    }

    fn put(mut self, lab: &Lab) -> TcpStream {
        if !self.headers.iter().any(|(name, _)| name == "Host") {
            self = self.with("Host", &format!("127.0.0.1:{}", lab.port));
        }
        let mut head = format!("{} {} HTTP/1.1\r\nConnection: close\r\n", self.method, self.path);
        for (name, value) in &self.headers {
            let _ = write!(head, "{name}: {value}\r\n");
        }
        head.push_str("\r\n");
        let mut stream = TcpStream::connect(("127.0.0.1", lab.port)).expect("the server listens");
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        // Who refuses a body may close the line before all of it is sent.
        let _ = stream.write_all(&self.body);
        stream
    }
}

/// What the server answers.
pub(crate) struct Answer {
    pub(crate) status: u16,
    headers: Vec<(String, String)>,
    pub(crate) body: String,
}

impl Answer {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let text = String::from_utf8_lossy(bytes);
        let (head, body) = text.split_once("\r\n\r\n")?;
        let mut lines = head.lines();
        let status = lines.next()?.split(' ').nth(1)?.parse().ok()?;
        let headers = lines.filter_map(|line| line.split_once(':'));
        let headers = headers.map(|(name, value)| (name.to_ascii_lowercase(), value.trim().to_owned()));
        Some(Self { status, headers: headers.collect(), body: body.to_owned() })
    }

    /// A header by its name in small letters.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error} in {}", self.body))
    }
}
