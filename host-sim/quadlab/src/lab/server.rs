//! The server: one folder, one port of this machine, until it is ended.

use std::io::Write as _;
use std::net::Ipv4Addr;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;

use anyhow::Context as _;

use super::guard::{self, Guard};
use super::routes;
use super::session::Session;

/// What to serve.
pub(crate) struct Options {
    /// Folder of flights.
    pub(crate) folder: PathBuf,
    /// 0 for any that is free.
    pub(crate) port: u16,
    /// Whether to open the browser.
    pub(crate) open: bool,
}

/// Serves until the program is interrupted.
pub(crate) fn serve(options: &Options) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(run(options))
}

async fn run(options: &Options) -> anyhow::Result<()> {
    let folder = options.folder.canonicalize().with_context(|| {
        format!("{}: cannot be opened; name the folder that contains the flights", options.folder.display())
    })?;
    anyhow::ensure!(
        folder.is_dir(),
        "{}: is a file; name the folder that contains the flights",
        options.folder.display()
    );
    let session = Arc::new(Session::open(&folder)?);
    let listener =
        tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, options.port)).await.with_context(|| {
            format!(
                "port {} of this machine cannot be used; give another with --port, or 0 for any",
                options.port
            )
        })?;
    let guard = Guard::new(listener.local_addr()?.port())?;
    let address = guard.address();
    let reading = session.clone();
    std::thread::spawn(move || reading.read_flights());
    // Whoever started the program reads the address here.
    println!("lab: {address}");
    std::io::stdout().flush()?;
    if options.open {
        open_browser(&address);
    }
    let app = routes::router(session).layer(axum::middleware::from_fn_with_state(guard, guard::check));
    tokio::select! {
        ended = axum::serve(listener, app) => ended?,
        _ = tokio::signal::ctrl_c() => {}
    }
    Ok(())
}

/// Opens the address in the user's browser; where that does not work, the address has been printed.
fn open_browser(address: &str) {
    let (program, arguments): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("rundll32", &["url.dll,FileProtocolHandler"]),
        _ => ("xdg-open", &[]),
    };
    let quiet = || Stdio::null();
    let opened = Command::new(program)
        .args(arguments)
        .arg(address)
        .stdin(quiet())
        .stdout(quiet())
        .stderr(quiet())
        .spawn();
    if opened.is_err() {
        eprintln!("no browser could be opened: open the address above in one");
    }
}
