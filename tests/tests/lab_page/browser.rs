//! A real browser without a window, steered over WebDriver.
//!
//! What it logs and what it asks the network for is read at the end: a page that uses anything but its own server, or
//! that writes an error to the console, fails its test.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::future::Future;
use std::io::{BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use fantoccini::elements::Element;
use fantoccini::error::{CmdError, ErrorStatus};
use fantoccini::key::Key;
use fantoccini::wd::{Capabilities, WebDriverCompatibleCommand};
use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use rustix::process::{Pid, Signal, kill_process_group};
use serde_json::{Value, json};
use tokio::runtime::{Builder, Runtime};

/// How long anything on the page may take: diagnoses run on machines that do other things too.
const PATIENCE: Duration = Duration::from_secs(180);
/// How long the browser may take for one command.
const ONE_COMMAND: Duration = Duration::from_secs(60);
/// How often a driver is started that ends at once.
const STARTS: usize = 20;
/// Whether what a selector finds can be clicked and stays in its place.
const AT_REST: &str = "const e = document.querySelector(arguments[0]);
    e?.scrollIntoView({ block: 'center' });
    if (!e || !e.checkVisibility() || e.disabled || e.ariaDisabled === 'true') return false;
    const place = () => { const { x, y, width, height } = e.getBoundingClientRect(); return `${[x, y, width, height]}`; };
    const before = place();
    return new Promise((answer) => setTimeout(() => answer(e.isConnected && place() === before), 50));";
/// Lets the next click through only to what a selector finds, and notes in `struck` whether it came there.
const GUARD: &str =
    "const selector = arguments[0], events = ['pointerdown', 'mousedown', 'pointerup', 'mouseup', 'click'];
    window.unguard?.();
    window.struck = null;
    const guard = (event) => {
        const hit = Boolean(event.target.closest?.(selector));
        if (!hit) { event.stopImmediatePropagation(); event.preventDefault(); }
        if (event.type === 'click') { window.struck = hit; window.unguard(); }
    };
    window.unguard = () => events.forEach((kind) => removeEventListener(kind, guard, true));
    events.forEach((kind) => addEventListener(kind, guard, true));";

/// What is missing on this machine, if so. In continuous integration that is a failure.
pub(crate) fn missing() -> bool {
    let needed = [("chromium", "chromium"), ("chromedriver", "chromium-driver")];
    let absent = needed.into_iter().find(|(program, _)| {
        let mut version = Command::new(program);
        version.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        !version.status().is_ok_and(|status| status.success())
    });
    let Some((program, package)) = absent else { return false };
    let line = format!("{program} is not installed: apt-get install --yes --no-install-recommends {package}");
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{line}");
    println!("SKIPPED: {line}");
    true
}

/// The program between test and browser. Its process group holds the browser too.
struct Driver {
    child: Child,
    port: u16,
}

impl Driver {
    fn start(home: &Path) -> Self {
        let log = home.join("driver.log");
        // It listens on some port of IPv6 and then on the same of IPv4, and ends where another program has that.
        let driver = (0..STARTS).find_map(|_| Self::attempt(home, &log));
        driver.unwrap_or_else(|| {
            panic!("chromedriver does not start: {}", fs::read_to_string(&log).unwrap_or_default())
        })
    }

    /// One start, if the driver then says its port.
    fn attempt(home: &Path, log: &Path) -> Option<Self> {
        // Its input is closed however the test ends. With that or with the driver all of its group ends.
        let mut child = Command::new("sh")
            .args(["-c", "{ chromedriver --port=0; kill -KILL 0; } & cat > /dev/null; kill -KILL 0"])
            .env("HOME", home)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(File::options().create(true).append(true).open(log).unwrap())
            .process_group(0)
            .spawn()
            .unwrap();
        let said = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        let mut driver = Self { child, port: 0 };
        let (sender, ports) = mpsc::channel();
        // It may go on to say things, and must not find its output closed.
        std::thread::spawn(move || {
            for line in said {
                let _ = sender.send(port_in(&line));
            }
        });
        let start = Instant::now();
        while driver.port == 0 {
            driver.port = ports.recv_timeout(ONE_COMMAND.saturating_sub(start.elapsed())).ok()?.unwrap_or(0);
        }
        Some(driver)
    }
}

/// The port that a line of chromedriver's says.
fn port_in(line: &str) -> Option<u16> {
    let (_, port) = line.split_once("started successfully on port ")?;
    port.trim_end_matches('.').parse().ok()
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
        let _ = self.child.wait();
    }
}

/// A command of chromedriver's own: path below the session, body.
#[derive(Debug)]
struct Vendor(&'static str, Value);

impl WebDriverCompatibleCommand for Vendor {
    fn endpoint(&self, base: &url::Url, session: Option<&str>) -> Result<url::Url, url::ParseError> {
        base.join(&format!("session/{}/{}", session.unwrap_or_default(), self.0))
    }

    fn method_and_body(&self, _: &url::Url) -> (http::Method, Option<String>) {
        (http::Method::POST, Some(self.1.to_string()))
    }
}

/// A browser with one window; it and its driver end with this value.
pub(crate) struct Browser {
    name: &'static str,
    client: Client,
    runtime: Runtime,
    /// Where a page may get anything from.
    ports: Vec<u16>,
    /// Files of this machine that are pages themselves.
    files: Vec<String>,
    // Ends before its folder is removed.
    _driver: Driver,
    folder: tempfile::TempDir,
}

impl Browser {
    /// A fresh browser for the test `name`.
    pub(crate) fn start(name: &'static str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let driver = Driver::start(folder.path());
        let runtime = Builder::new_current_thread().enable_all().build().unwrap();
        let mut builder = ClientBuilder::new(HttpConnector::new());
        builder.capabilities(capabilities(folder.path()));
        let address = format!("http://127.0.0.1:{}", driver.port);
        let limited = async { tokio::time::timeout(PATIENCE, builder.connect(&address)).await };
        let client =
            runtime.block_on(limited).expect("the browser starts in time").expect("the browser starts");
        Self { name, client, runtime, ports: Vec::new(), files: Vec::new(), _driver: driver, folder }
    }

    fn done<T>(&self, what: &str, work: impl Future<Output = Result<T, CmdError>>) -> T {
        self.limited(what, work).unwrap_or_else(|error| panic!("{}: {what}: {error}", self.name))
    }

    /// What a command gives, if the browser answers in time.
    fn limited<T>(&self, what: &str, work: impl Future<Output = Result<T, CmdError>>) -> Result<T, CmdError> {
        let limited = async { tokio::time::timeout(ONE_COMMAND, work).await };
        let answer = self.runtime.block_on(limited);
        answer.unwrap_or_else(|_| panic!("{}: {what}: the browser does not answer", self.name))
    }

    /// Opens an address on this machine.
    pub(crate) fn open(&mut self, address: &str) {
        self.ports.push(url::Url::parse(address).unwrap().port().expect("a port"));
        self.done(address, self.client.goto(address));
    }

    /// Opens a page that is a file.
    pub(crate) fn open_file(&mut self, path: &Path) {
        let address = url::Url::from_file_path(path).expect("an absolute path").to_string();
        self.done(&address, self.client.goto(&address));
        self.files.push(address);
    }

    /// Opens a page that is written here.
    pub(crate) fn open_text(&self, html: &str) {
        let address =
            format!("data:text/html;charset=utf-8,{}", html.replace('%', "%25").replace('#', "%23"));
        self.done("a page of text", self.client.goto(&address));
    }

    /// A second tab, in front from now on; gives the handle of the first.
    pub(crate) fn second_tab(&self) -> [fantoccini::wd::WindowHandle; 2] {
        let first = self.done("window", self.client.window());
        let second = self.done("new tab", self.client.new_window(true)).handle;
        self.to_tab(&second);
        [first, second]
    }

    /// Brings a tab to the front.
    pub(crate) fn to_tab(&self, tab: &fantoccini::wd::WindowHandle) {
        self.done("to tab", self.client.switch_to_window(tab.clone()));
    }

    /// What a script on the page returns; `arguments[0]` is `argument`.
    pub(crate) fn run(&self, script: &str, argument: impl Into<Value>) -> Value {
        self.done(script, self.client.execute(script, vec![argument.into()]))
    }

    /// What a command of Chromium's developer tools gives.
    pub(crate) fn devtools(&self, command: &str, parameters: Value) -> Value {
        let body = json!({ "cmd": command, "params": parameters });
        self.done(command, self.client.issue_cmd(Vendor("goog/cdp/execute", body)))
    }

    /// Waits until a script returns true.
    pub(crate) fn wait_until(&self, what: &str, script: &str, argument: impl Into<Value>) {
        let (argument, start) = (argument.into(), Instant::now());
        while self.run(script, argument.clone()) != Value::Bool(true) {
            if start.elapsed() > PATIENCE {
                panic!("{}: {what} does not come; {}", self.name, self.state());
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Waits until a visible element that `selector` finds holds `text`.
    pub(crate) fn wait_for(&self, selector: &str, text: &str) {
        let script = "const [selector, text] = arguments[0];
            return [...document.querySelectorAll(selector)].some(e => e.checkVisibility() && e.textContent.includes(text))";
        self.wait_until(&format!("{selector} with \"{text}\""), script, json!([selector, text]));
    }

    /// Waits until nothing that `selector` finds can be seen.
    pub(crate) fn wait_for_no(&self, selector: &str) {
        let script = "return [...document.querySelectorAll(arguments[0])].every(e => !e.checkVisibility())";
        self.wait_until(&format!("an end of {selector}"), script, selector);
    }

    /// Clicks as a user does: what lies beneath something else cannot be clicked. A click waits until its aim stays where
    /// it is; one that strikes something else, because the page moved beneath the pointer, does nothing and is made again.
    pub(crate) fn click(&self, selector: &str) {
        let (what, start) = (format!("click on {selector}"), Instant::now());
        loop {
            let why = match self.click_once(selector, &what) {
                Ok(true) => return,
                Ok(false) => "it strikes something else".to_owned(),
                Err(error) if is_of_a_moment(&error) => error.to_string(),
                Err(error) => panic!("{}: {what}: {error}; {}", self.name, self.state()),
            };
            assert!(start.elapsed() < PATIENCE, "{}: {what}: {why}; {}", self.name, self.state());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// One click, once its aim rests; gives whether it came there.
    fn click_once(&self, selector: &str, what: &str) -> Result<bool, CmdError> {
        self.wait_until(&format!("{selector} to click"), AT_REST, selector);
        self.run(GUARD, selector);
        let click = async { self.client.find(Locator::Css(selector)).await?.click().await };
        self.limited(what, click)?;
        // A page that the click has opened knows nothing of it.
        Ok(self.run("return window.struck !== false && window.struck !== null", Value::Null) == true)
    }

    /// Moves the pointer to the middle of what can be seen of an element.
    pub(crate) fn point(&self, selector: &str) {
        let place = "const e = document.querySelector(arguments[0]);
            e.scrollIntoView({ block: 'nearest' });
            const { left, top, right, bottom } = e.getBoundingClientRect();
            return [(left + right) / 2, (Math.max(0, top) + Math.min(innerHeight, bottom)) / 2]";
        let at = self.run(place, selector);
        self.point_at([0, 1].map(|n| at[n].as_f64().expect("a place")));
    }

    /// Drags from one place of the window to another with the left button.
    pub(crate) fn drag(&self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mouseMoved", from, 0);
        self.mouse("mousePressed", from, 1);
        self.mouse("mouseMoved", [0, 1].map(|n| 0.5 * (from[n] + to[n])), 1);
        self.mouse("mouseMoved", to, 1);
        self.mouse("mouseReleased", to, 1);
    }

    /// Clicks twice on a place of the window.
    pub(crate) fn double_click(&self, at: [f64; 2]) {
        for count in [1, 2] {
            self.mouse("mousePressed", at, count);
            self.mouse("mouseReleased", at, count);
        }
    }

    fn mouse(&self, kind: &str, [x, y]: [f64; 2], count: u32) {
        let button = if count == 0 { "none" } else { "left" };
        let event = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": count.min(1), "clickCount": count });
        self.devtools("Input.dispatchMouseEvent", event);
    }

    /// Types letters.
    pub(crate) fn type_keys(&self, keys: &str) {
        let press = async { self.client.active_element().await?.send_keys(keys).await };
        self.done(keys, press);
    }

    /// Moves the pointer to a place of the window, CSS pixels.
    pub(crate) fn point_at(&self, at: [f64; 2]) {
        self.mouse("mouseMoved", at, 0);
    }

    /// Types into a field in the place of what is there.
    pub(crate) fn fill(&self, selector: &str, text: &str) {
        self.with(selector, &format!("{text} into {selector}"), async |field| {
            field.clear().await?;
            field.send_keys(text).await
        });
    }

    /// Types behind what is in a field.
    pub(crate) fn append(&self, selector: &str, text: &str) {
        self.with(selector, &format!("{text} behind {selector}"), async |field| field.send_keys(text).await);
    }

    /// Chooses an option of a select by its value.
    pub(crate) fn choose(&self, selector: &str, value: &str) {
        self.with(selector, &format!("choice of {value} in {selector}"), async |select| {
            select.select_by_value(value).await
        });
    }

    /// Chooses files of this machine in an input for files.
    pub(crate) fn attach(&self, selector: &str, files: &[PathBuf]) {
        let names = files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join("\n");
        self.with(selector, &format!("files for {selector}"), async |input| input.send_keys(&names).await);
    }

    /// Does something with the element that `selector` finds; once more where it is drawn anew in between.
    fn with(&self, selector: &str, what: &str, work: impl AsyncFn(Element) -> Result<(), CmdError>) {
        let start = Instant::now();
        loop {
            let all = async { work(self.client.find(Locator::Css(selector)).await?).await };
            match self.limited(what, all) {
                Ok(()) => return,
                Err(error) if error.is_stale_element_reference() && start.elapsed() < PATIENCE => {}
                Err(error) => panic!("{}: {what}: {error}; {}", self.name, self.state()),
            }
        }
    }

    /// Waits until nothing on the page has changed for half a second.
    pub(crate) fn settle(&self) {
        let start = Instant::now();
        let (mut last, mut same) = (Value::Null, 0);
        let state = "return [performance.getEntriesByType('resource').length, document.documentElement.outerHTML.length]";
        while same < 5 {
            let now = self.run(state, Value::Null);
            same = if now == last { same + 1 } else { 0 };
            last = now;
            assert!(start.elapsed() < PATIENCE, "{}: the page does not come to rest", self.name);
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Text of all that `selector` finds.
    pub(crate) fn text(&self, selector: &str) -> String {
        let script =
            "return [...document.querySelectorAll(arguments[0])].map(e => e.textContent).join('\\n')";
        self.run(script, selector).as_str().unwrap_or_default().to_owned()
    }

    /// How many elements `selector` finds.
    pub(crate) fn count(&self, selector: &str) -> usize {
        let count = self.run("return document.querySelectorAll(arguments[0]).length", selector);
        count.as_u64().map_or(0, |count| count as usize)
    }

    /// Presses a key some times.
    pub(crate) fn press(&self, key: Key, times: usize) {
        self.type_keys(&char::from(key).to_string().repeat(times));
    }

    /// Has the page drawn for eyes that want it `light` or `dark`.
    pub(crate) fn prefer(&self, scheme: &str) {
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.devtools("Emulation.setEmulatedMedia", features);
    }

    /// The content of a file once it is downloaded.
    pub(crate) fn downloaded(&self, name: &str) -> String {
        String::from_utf8(self.downloaded_bytes(name)).expect("a text")
    }

    /// The same of a file that is no text.
    pub(crate) fn downloaded_bytes(&self, name: &str) -> Vec<u8> {
        let (path, start) = (self.folder.path().join("downloads").join(name), Instant::now());
        loop {
            match fs::read(&path) {
                Ok(bytes) if !bytes.is_empty() => return bytes,
                _ if start.elapsed() > PATIENCE => {
                    panic!("{}: {name} is not downloaded; {}", self.name, self.state())
                }
                _ => std::thread::sleep(Duration::from_millis(50)),
            }
        }
    }

    /// Leaves a picture of the page in `target/tmp/lab_page`.
    pub(crate) fn screenshot(&self, picture: &str) -> PathBuf {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lab_page");
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join(format!("{}-{picture}.png", self.name));
        fs::write(&path, self.done("screenshot", self.client.screenshot())).unwrap();
        path
    }

    /// What to show of a page on which something did not come.
    fn state(&self) -> String {
        let picture = self.screenshot("failed");
        let mut state = format!("picture: {}\npage: {}", picture.display(), self.text("main, body > *"));
        for line in self.log("browser") {
            let _ = write!(state, "\nconsole: {} {}", line["level"], line["message"]);
        }
        state
    }

    /// What was logged since it was asked for last.
    fn log(&self, kind: &str) -> Vec<Value> {
        let lines = self.done("log", self.client.issue_cmd(Vendor("se/log", json!({ "type": kind }))));
        serde_json::from_value(lines).expect("a list of lines")
    }

    /// Ends the browser: no error on the console but those that hold one of `expected`, and nothing asked for elsewhere.
    pub(crate) fn finish(self, expected: &[&str]) {
        let of_line = |line: &Value, name: &str| line[name].as_str().unwrap_or_default().to_owned();
        for line in self.log("browser") {
            let message = of_line(&line, "message");
            let is_error = of_line(&line, "level") == "SEVERE";
            assert!(
                !is_error || expected.iter().any(|known| message.contains(known)),
                "{}: on the console: {message}",
                self.name
            );
        }
        let asked: Vec<String> = self.log("performance").iter().filter_map(address).collect();
        assert!(!asked.is_empty(), "{}: nothing of the network is logged", self.name);
        let foreign: Vec<&String> = asked.iter().filter(|address| !self.is_own(address)).collect();
        assert!(foreign.is_empty(), "{}: the page asked for {foreign:?}", self.name);
        let close = async { tokio::time::timeout(ONE_COMMAND, self.client.clone().close()).await };
        let _ = self.runtime.block_on(close);
    }

    fn is_own(&self, address: &str) -> bool {
        // A new tab is a page of the browser itself.
        ["data:", "blob:", "about:", "chrome:"].iter().any(|scheme| address.starts_with(scheme))
            || self.files.iter().any(|file| file == address)
            || self.ports.iter().any(|port| address.starts_with(&format!("http://127.0.0.1:{port}/")))
    }
}

/// Whether an element was drawn anew or covered just when it was clicked.
fn is_of_a_moment(error: &CmdError) -> bool {
    let CmdError::Standard(answer) = error else { return false };
    matches!(answer.error, ErrorStatus::StaleElementReference | ErrorStatus::ElementClickIntercepted)
}

/// What a line of the network's log asks for.
fn address(line: &Value) -> Option<String> {
    let message: Value = serde_json::from_str(line["message"].as_str()?).ok()?;
    let message = &message["message"];
    let asks =
        ["Network.requestWillBeSent", "Network.webSocketCreated"].iter().any(|m| message["method"] == *m);
    let parameters = &message["params"];
    let address = parameters["request"]["url"].as_str().or_else(|| parameters["url"].as_str());
    address.filter(|_| asks).map(ToOwned::to_owned)
}

fn capabilities(folder: &Path) -> Capabilities {
    let arguments = [
        "--headless=new".to_owned(),
        "--no-sandbox".to_owned(),
        "--disable-gpu".to_owned(),
        "--disable-dev-shm-usage".to_owned(),
        "--window-size=1600,1000".to_owned(),
        // Not even by mistake.
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1".to_owned(),
        format!("--user-data-dir={}", folder.join("profile").display()),
    ];
    let options = json!({
        "args": arguments,
        "prefs": {
            "download.default_directory": folder.join("downloads"),
            // A figure is drawn before it is saved: on a slow machine the click is long past by then.
            "profile.default_content_setting_values.automatic_downloads": 1,
        },
    });
    Capabilities::from_iter([
        ("goog:chromeOptions".to_owned(), options),
        ("goog:loggingPrefs".to_owned(), json!({ "browser": "ALL", "performance": "ALL" })),
    ])
}

/// A button that once gives way to another just before it is pressed.
const EVASIVE: &str = "<button id=other onclick='this.dataset.struck = 1' hidden>other</button>
    <button id=aim>aim</button>
    <script>
    addEventListener('mousemove', () => { document.getElementById('other').hidden = false; }, { once: true });
    document.getElementById('aim').onclick = (event) => { event.target.dataset.struck = Number(event.target.dataset.struck ?? 0) + 1; };
    </script>";

#[test]
fn a_click_that_strikes_something_else_does_nothing_and_is_made_again() {
    if missing() {
        return;
    }
    let browser = Browser::start("evasive");
    browser.open_text(EVASIVE);
    browser.click("#aim");
    let struck =
        |id: &str| browser.run("return document.getElementById(arguments[0]).dataset.struck ?? null", id);
    assert_eq!((struck("aim"), struck("other")), ("1".into(), Value::Null));
}
