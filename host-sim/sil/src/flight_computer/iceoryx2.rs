//! Controller and plant in two processes, over shared memory (iceoryx2).
//!
//! The plant's process asks, the controller's answers: one request and one response a tick, each a
//! frame of crate `proto`, and an event each way that wakes the sleeper. Every run is an iceoryx2
//! domain of its own: its files carry the run's name, so that runs side by side do not meet, and
//! nothing stays behind when the run is over.
//!
//! The configuration goes to the controller's process as one line of JSON on its standard input,
//! which stays open: its end tells the controller that the plant is done, however that happened. In
//! the other direction the plant looks whether the controller's process still lives whenever it has
//! waited in vain. The plant gives up its own share of the domain before it closes that input, so
//! the controller leaves last and clears the domain away; the plant does so too if it had to kill
//! the controller. (If both are killed outright, a few kilobytes named `quadlab_*` stay in /dev/shm
//! and in the temporary folder.)

use std::io::{BufRead, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use control::{Config, Readings};
use craft::{Lockstep, convert};
use iceoryx2::port::client::Client;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::*;
use proto::{MAX_FRAME_LEN, Message};

use super::in_process::{FlightComputer, FlightComputerError};

type Ipc = ipc::Service;
type Asking = Client<Ipc, [u8], (), [u8], ()>;
type Answering = Server<Ipc, [u8], (), [u8], ()>;

/// How long one wait lasts before it is checked that the other side still runs.
const LOOK: Duration = Duration::from_millis(50);
/// How long the other side may take for anything.
const PATIENCE: Duration = Duration::from_secs(10);
/// Ticks between two checks for Ctrl-C; a tick takes some 50 us.
const TICKS_BETWEEN_LOOKS: u32 = 100;

fn refused<E: std::fmt::Debug>(what: &'static str) -> impl Fn(E) -> FlightComputerError {
    move |error| FlightComputerError::Middleware { what, reason: format!("{error:?}") }
}

/// The middleware's files of one run: those in `root`, and shared memory whose names start with
/// `prefix`.
struct Domain {
    prefix: String,
    root: PathBuf,
}

impl Domain {
    fn new(run: &str) -> Self {
        let prefix = format!("quadlab_{run}_");
        Self { root: std::env::temp_dir().join(&prefix), prefix }
    }

    fn node(&self) -> Result<Node<Ipc>, FlightComputerError> {
        set_log_level(LogLevel::Fatal);
        // From the defaults, not from a file of the user's that could differ between the two
        // processes.
        let mut config = iceoryx2::config::Config::default();
        config.global.prefix = FileName::new(self.prefix.as_bytes()).map_err(refused("name its files"))?;
        let root = iceoryx2::prelude::Path::new(self.root.as_os_str().as_encoded_bytes());
        config.global.set_root_path(&root.map_err(refused("name its folder"))?);
        let node = NodeBuilder::new().config(&config).create::<Ipc>().map_err(refused("create a node"))?;
        // The first wait installs the handler that turns Ctrl-C into an error of later waits.
        node.wait(Duration::ZERO).map_err(|_| FlightComputerError::Interrupted)?;
        Ok(node)
    }

    /// Removes what is left when both sides are done. Linux keeps POSIX shared memory in /dev/shm;
    /// where that is not so, only the folder goes.
    fn remove(&self) {
        let shared = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        for entry in shared.filter(|e| e.file_name().to_string_lossy().starts_with(&self.prefix)) {
            let _ = std::fs::remove_file(entry.path());
        }
        let _ = std::fs::remove_dir_all(&self.root);
    }
}

/// The services of one run.
struct Services {
    ticks: iceoryx2::service::port_factory::request_response::PortFactory<Ipc, [u8], (), [u8], ()>,
    asked: iceoryx2::service::port_factory::event::PortFactory<Ipc>,
    answered: iceoryx2::service::port_factory::event::PortFactory<Ipc>,
}

impl Services {
    fn name(run: &str, part: &str) -> Result<ServiceName, FlightComputerError> {
        ServiceName::new(&format!("quadlab/sil/{run}/{part}")).map_err(refused("name a service"))
    }

    fn open_or_create(node: &Node<Ipc>, run: &str) -> Result<Self, FlightComputerError> {
        let event = |part| -> Result<_, FlightComputerError> {
            node.service_builder(&Self::name(run, part)?)
                .event()
                .open_or_create()
                .map_err(refused("create an event service"))
        };
        let ticks = node
            .service_builder(&Self::name(run, "ticks")?)
            .request_response::<[u8], [u8]>()
            .open_or_create()
            .map_err(refused("create a request-response service"))?;
        Ok(Self { ticks, asked: event("asked")?, answered: event("answered")? })
    }
}

/// A controller in a process of its own.
pub struct Iceoryx2 {
    client: Asking,
    asked: Notifier<Ipc>,
    answered: Listener<Ipc>,
    node: Node<Ipc>,
    buffer: [u8; MAX_FRAME_LEN],
    /// Last, because it is dropped last: when this side has given up its share of the domain.
    controller: Peer,
}

/// The controller's process. It is told to leave when this goes.
struct Peer {
    child: Child,
    domain: Domain,
}

impl Drop for Peer {
    fn drop(&mut self) {
        drop(self.child.stdin.take());
        let started = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) {
            if started.elapsed() > PATIENCE {
                let _ = self.child.kill();
                let _ = self.child.wait();
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.domain.remove();
    }
}

impl Iceoryx2 {
    /// Starts `program --controller RUN` (which has to call [`serve`]) with a configuration and
    /// waits until it listens.
    ///
    /// # Errors
    /// The program cannot be started, ends at once, or the middleware refuses something.
    pub fn start(program: &Path, config: &Config) -> Result<Self, FlightComputerError> {
        let run = unused_name();
        let domain = Domain::new(&run);
        // Before anything of the domain exists: from here on there is somebody to clear it away.
        let controller = Peer { child: spawn(program, &run)?, domain };
        let node = controller.domain.node()?;
        let services = Services::open_or_create(&node, &run)?;
        let client = services
            .ticks
            .client_builder()
            .initial_max_slice_len(MAX_FRAME_LEN)
            .create()
            .map_err(refused("create a client"))?;
        let asked = services.asked.notifier_builder().create().map_err(refused("create a notifier"))?;
        let answered = services.answered.listener_builder().create().map_err(refused("create a listener"))?;
        let buffer = [0; MAX_FRAME_LEN];
        let mut link = Self { client, asked, answered, node, buffer, controller };
        link.configure(config).map_err(|error| link.explain(error))?;
        let started = Instant::now();
        let there = || {
            services.ticks.dynamic_config().number_of_servers() > 0
                && services.asked.dynamic_config().number_of_listeners() > 0
                && services.answered.dynamic_config().number_of_notifiers() > 0
        };
        while !there() {
            std::thread::sleep(Duration::from_millis(1));
            link.look(started).map_err(|error| link.explain(error))?;
        }
        Ok(link)
    }

    /// Hands the configuration over. The input stays open: its end is the sign to leave.
    fn configure(&mut self, config: &Config) -> Result<(), FlightComputerError> {
        let failed = |reason| FlightComputerError::Configure { reason };
        let mut line = serde_json::to_vec(config).map_err(|error| failed(error.into()))?;
        line.push(b'\n');
        self.controller.child.stdin.as_mut().map_or(Ok(()), |stdin| stdin.write_all(&line)).map_err(failed)
    }

    /// The cause behind an error: an interrupt or the end of the controller's process causes
    /// others.
    fn explain(&mut self, error: FlightComputerError) -> FlightComputerError {
        // A killed process takes a moment to be gone.
        if self.node.wait(LOOK).is_err() {
            return FlightComputerError::Interrupted;
        }
        match self.controller.child.try_wait() {
            Ok(Some(status)) => FlightComputerError::PeerGone { status: status.to_string() },
            _ => error,
        }
    }

    /// Whether it makes sense to go on waiting since `started`.
    fn look(&mut self, started: Instant) -> Result<(), FlightComputerError> {
        self.node.wait(Duration::ZERO).map_err(|_| FlightComputerError::Interrupted)?;
        if let Ok(Some(status)) = self.controller.child.try_wait() {
            return Err(FlightComputerError::PeerGone { status: status.to_string() });
        }
        if started.elapsed() > PATIENCE {
            return Err(FlightComputerError::Silent { seconds: PATIENCE.as_secs() });
        }
        Ok(())
    }

    fn send(&mut self, message: &Message) -> Result<Pending, FlightComputerError> {
        let frame = proto::encode(message, &mut self.buffer)?;
        let request = self.client.loan_slice_uninit(frame.len()).map_err(refused("lend memory"))?;
        let pending = request.write_from_slice(frame).send().map_err(refused("send a request"))?;
        self.asked.notify().map_err(refused("wake the controller"))?;
        Ok(pending)
    }
}

type Pending = iceoryx2::pending_response::PendingResponse<Ipc, [u8], (), [u8], ()>;

/// Unique among the runs of this machine: the process and the moment.
fn unused_name() -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let nanoseconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    format!("{:x}-{nanoseconds:x}-{count:x}", std::process::id())
}

fn spawn(program: &Path, run: &str) -> Result<Child, FlightComputerError> {
    let mut command = std::process::Command::new(program);
    command.args(["--controller", run]).stdin(Stdio::piped()).stdout(Stdio::null());
    // In a group of its own Ctrl-C does not reach it: the plant is interrupted and ends it
    // properly.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
        .spawn()
        .map_err(|reason| FlightComputerError::Start { program: program.display().to_string(), reason })
}

impl FlightComputer for Iceoryx2 {
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, FlightComputerError> {
        self.ask(tick, readings).map_err(|error| self.explain(error))
    }
}

impl Iceoryx2 {
    fn ask(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, FlightComputerError> {
        let started = Instant::now();
        if tick.is_multiple_of(TICKS_BETWEEN_LOOKS) {
            self.look(started)?;
        }
        let pending = self.send(&Message::Readings(convert::readings_message(tick, readings)))?;
        loop {
            if let Some(response) = pending.receive().map_err(refused("receive a response"))? {
                return match proto::decode(response.payload())? {
                    Message::Outcome(outcome) if outcome.output.tick == tick => Ok(outcome),
                    other => {
                        Err(FlightComputerError::WrongAnswer { expected: tick, found: format!("{other:?}") })
                    }
                };
            }
            // An interrupted or empty wait is no reason to give up; `look` knows the reasons.
            if !matches!(self.answered.timed_wait(|_| {}, LOOK), Ok(1..)) {
                self.look(started)?;
            }
        }
    }
}

/// The controller's side: reads its configuration from standard input, answers ticks of run `run`,
/// and returns when the input ends.
///
/// # Errors
/// A configuration that cannot be read or flown, or what the middleware refuses.
pub fn serve(run: &str) -> Result<(), FlightComputerError> {
    let domain = Domain::new(run);
    let outcome = answer_until_input_ends(run, &domain);
    domain.remove();
    outcome
}

fn answer_until_input_ends(run: &str, domain: &Domain) -> Result<(), FlightComputerError> {
    let Some(config) = read_config()? else { return Ok(()) };
    let mut lockstep = Lockstep::new(&config)?;
    let plant_done = watch_input();
    let node = domain.node()?;
    let services = Services::open_or_create(&node, run)?;
    let answered = services.answered.notifier_builder().create().map_err(refused("create a notifier"))?;
    let asked = services.asked.listener_builder().create().map_err(refused("create a listener"))?;
    let server = services
        .ticks
        .server_builder()
        .initial_max_slice_len(MAX_FRAME_LEN)
        .create()
        .map_err(refused("create a server"))?;
    while !plant_done.load(Ordering::Relaxed) {
        // An interrupted wait is like an empty one: whether to go on is the plant's to decide.
        let _ = asked.timed_wait(|_| {}, LOOK);
        answer_all(&server, &answered, &mut lockstep)?;
    }
    Ok(())
}

/// Answers what has come.
fn answer_all(
    server: &Answering,
    answered: &Notifier<Ipc>,
    lockstep: &mut Lockstep,
) -> Result<(), FlightComputerError> {
    let mut buffer = [0; MAX_FRAME_LEN];
    while let Some(request) = server.receive().map_err(refused("receive a request"))? {
        // An output is not for this side; the plant will miss an answer and say so.
        let Some(outcome) = lockstep.answer(&proto::decode(request.payload())?) else { continue };
        let frame = proto::encode(&Message::Outcome(outcome), &mut buffer)?;
        let response = request.loan_slice_uninit(frame.len()).map_err(refused("lend memory"))?;
        response.write_from_slice(frame).send().map_err(refused("send a response"))?;
        answered.notify().map_err(refused("wake the plant"))?;
    }
    Ok(())
}

/// `None` if the plant went before it sent one.
fn read_config() -> Result<Option<Config>, FlightComputerError> {
    let mut line = String::new();
    let failed = |reason| FlightComputerError::Configure { reason };
    if std::io::stdin().lock().read_line(&mut line).map_err(failed)? == 0 {
        return Ok(None);
    }
    serde_json::from_str(&line).map(Some).map_err(|error| failed(error.into()))
}

/// Becomes true when standard input ends.
fn watch_input() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&ended);
    std::thread::spawn(move || {
        // Nothing more is written; only the end is waited for.
        let _ = std::io::stdin().lock().read_to_end(&mut Vec::new());
        flag.store(true, Ordering::Relaxed);
    });
    ended
}
