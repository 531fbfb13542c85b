//! What a page of somebody else, or another program of this machine, may not do to the lab: plain
//! HTTP, byte by byte.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;

use tempfile::TempDir;

use crate::browser::missing;
use crate::flights;
use crate::server::{Answer, Lab, Request, command, output};

/// All that is read, and a job.
const READS: [&str; 17] = [
    "/",
    "/page/plotly.min.js",
    "/api/state",
    "/api/events",
    "/api/model?id=1",
    "/api/diagnosis?model=1",
    "/api/series?model=1&flight=A.csv&from=0&to=1&width=10",
    "/api/quantities",
    "/api/vehicle",
    "/api/comparison?id=1",
    "/api/effects/names",
    "/api/download/model.toml?id=1",
    "/api/download/report.html?id=1",
    "/api/download/series.parquet?model=1&flight=A.csv",
    "/api/room?model=1&axis=w",
    "/api/timeline?model=1",
    "/api/next?model=1&effect=steady-wind&other=attitude-offset",
];
const WRITES: [(&str, &str); 14] = [
    ("/api/sets", r#"{"name":"A.csv","set":"none"}"#),
    ("/api/use", r#"{"name":"A.csv","parts":[[2,9]]}"#),
    ("/api/notes", r#"{"flight":"A.csv","text":"x"}"#),
    ("/api/current", r#"{"model":1}"#),
    ("/api/jobs", r#"{"do":"identify"}"#),
    ("/api/cancel", "{}"),
    ("/api/read", "{}"),
    ("/api/vehicle", "{}"),
    ("/api/upload?name=x.csv", "t"),
    ("/api/effects/check", r#"{"text":""}"#),
    ("/api/effects/preview", r#"{"text":"","model":1,"flight":"A.csv"}"#),
    ("/api/effects/try", r#"{"text":"","model":1}"#),
    ("/api/effects/keep", r#"{"text":""}"#),
    ("/api/effects/remove", r#"{"id":"x"}"#),
];

/// Refused, in one sentence that says why.
fn assert_refused(answer: &Answer, what: &str) {
    assert!((400..500).contains(&answer.status), "{what}: status {}", answer.status);
    let sentence = answer.json()["error"].as_str().unwrap_or_default().to_owned();
    assert!(sentence.len() > 10, "{what}: refused without a word: {:?}", answer.body);
    assert!(!sentence.contains("bug"), "{what}: {sentence}");
    assert!(answer.header("set-cookie").is_none(), "{what}: refused with a cookie");
}

fn set_of(lab: &Lab, name: &str) -> String {
    let state = lab.state();
    let flights = state["flights"].as_array().expect("flights");
    let flight = flights.iter().find(|flight| flight["name"] == name);
    flight.unwrap_or_else(|| panic!("{name} is not in {state}"))["set"].as_str().unwrap().to_owned()
}

#[test]
fn nothing_is_given_without_the_token() {
    let folder = flights::small();
    let lab = Lab::start(folder.path());
    assert!(lab.token.len() >= 22, "a token of {} characters can be guessed", lab.token.len());
    let other = Lab::start(flights::small().path()).token.clone();
    assert_ne!(lab.token, other, "two servers have one token");
    let mut wrong = lab.token.clone();
    wrong.pop();
    for path in READS {
        let answer = Request::get(path).send(&lab);
        assert_eq!(answer.status, 403, "{path}: {}", answer.body);
        assert_refused(&answer, path);
        let cookie = format!("token={other}; lab={other}; session={other}");
        assert_eq!(Request::get(path).with("Cookie", &cookie).send(&lab).status, 403, "{path}");
    }
    for token in [wrong.as_str(), "", &other, &format!("{}x", lab.token)] {
        assert_eq!(Request::get(&format!("/?token={token}")).send(&lab).status, 403, "{token}");
    }
    let before = set_of(&lab, "A.csv");
    for (path, body) in WRITES {
        let answer = Request::post(path, body).with_origin(&lab).send(&lab);
        assert_eq!(answer.status, 403, "{path}: {}", answer.body);
    }
    assert_eq!(set_of(&lab, "A.csv"), before);
}

#[test]
fn the_cookie_is_for_this_page_alone() {
    let folder = flights::small();
    let lab = Lab::start(folder.path());
    let answer = Request::get(&format!("/?token={}", lab.token)).send(&lab);
    assert!((300..400).contains(&answer.status), "{}", answer.status);
    assert_eq!(answer.header("location"), Some("/"));
    let cookie = answer.header("set-cookie").expect("a cookie").to_ascii_lowercase();
    for needed in ["httponly", "samesite=strict"] {
        assert!(cookie.contains(needed), "{needed} is not in {cookie}");
    }
    let page = lab.visitor().get("/").send(&lab);
    assert_eq!(page.status, 200);
    let policy = page.header("content-security-policy").expect("a policy");
    let rule = |name: &str| policy.split(';').map(str::trim).find(|rule| rule.starts_with(name));
    assert_eq!(rule("default-src"), Some("default-src 'none'"));
    assert_eq!(rule("script-src"), Some("script-src 'self'"));
    assert_eq!(rule("connect-src"), Some("connect-src 'self'"));
    assert_eq!(rule("frame-ancestors"), Some("frame-ancestors 'none'"));
    assert!(!policy.contains("unsafe-eval"), "{policy}");
    // What is downloaded or asked for is never taken for a page.
    for path in ["/", "/api/state"] {
        let answer = lab.visitor().get(path).send(&lab);
        assert_eq!(answer.header("x-content-type-options"), Some("nosniff"), "{path}");
        assert!(answer.header("access-control-allow-origin").is_none(), "{path}");
    }
}

/// A name of somebody else's that points to this machine (DNS rebinding).
#[test]
fn another_host_or_origin_is_refused() {
    let folder = flights::small();
    let lab = Lab::start(folder.path());
    let (visitor, port) = (lab.visitor(), lab.port);
    for host in ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "", "0.0.0.0"] {
        for path in ["/", "/api/state", &format!("/?token={}", lab.token)] {
            assert_refused(&visitor.get(path).with("Host", host).send(&lab), &format!("host {host}, {path}"));
        }
    }
    let before = set_of(&lab, "A.csv");
    let origins = [
        "http://evil.example".to_owned(),
        "null".to_owned(),
        "http://127.0.0.1".to_owned(),
        format!("https://127.0.0.1:{port}"),
        format!("http://127.0.0.1:{}", port ^ 1),
        format!("http://127.0.0.1:{port}.evil.example"),
        format!("http://evil.example:{port}"),
    ];
    for (path, body) in WRITES {
        for origin in &origins {
            let answer = visitor.post(path, body).with("Origin", origin).send(&lab);
            assert_refused(&answer, &format!("{path} from {origin}"));
        }
        assert_refused(&visitor.post(path, body).send(&lab), &format!("{path} without an origin"));
        // What a form of another page can send without asking.
        for form in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"] {
            let answer = visitor.post(path, body).with_origin(&lab).with("Content-Type", form).send(&lab);
            assert_refused(&answer, &format!("{path} as {form}"));
        }
    }
    assert_eq!(set_of(&lab, "A.csv"), before);
    let allowed = visitor.post(WRITES[0].0, WRITES[0].1).with_origin(&lab).send(&lab);
    assert_eq!(allowed.status, 200, "{}", allowed.body);
    assert_eq!(set_of(&lab, "A.csv"), "none");
}

#[test]
fn no_path_leads_out_of_the_folder() {
    let folder = flights::small();
    let lab = Lab::start(folder.path());
    lab.identify();
    let visitor = lab.visitor();
    for path in [
        "/page/../../Cargo.toml",
        "/page/..%2f..%2fCargo.toml",
        "/page/%2e%2e/%2e%2e/Cargo.toml",
        "/page/....//....//Cargo.toml",
        "/page//etc/passwd",
        "/page/..\\..\\Cargo.toml",
        "/../../../../etc/passwd",
        "/page/index.html%00.js",
    ] {
        assert_refused(&visitor.get(path).send(&lab), path);
    }
    for flight in
        ["../../etc/passwd", "..%2f..%2fetc%2fpasswd", "%2fetc%2fpasswd", "/etc/passwd", "A.csv%00", ""]
    {
        for path in [
            "/api/series?from=0&to=1&width=10&",
            "/api/download/series.csv?",
            "/api/path?axis=u&",
            "/api/spectrum?axis=u&",
        ] {
            let answer = visitor.get(&format!("{path}model=1&flight={flight}")).send(&lab);
            assert_refused(&answer, &format!("{path} of {flight}"));
            assert!(!answer.body.contains("root:"), "{}", answer.body);
        }
    }
    for name in ["../../etc/passwd", "/etc/passwd", "", "B.csv/../A.csv"] {
        let body = serde_json::json!({ "name": name, "set": "train" }).to_string();
        assert_refused(&visitor.post("/api/sets", &body).with_origin(&lab).send(&lab), name);
    }
}

/// Flights in the folder `flights` of a folder, out of which nothing may be written.
fn flights_in_a_folder() -> (TempDir, PathBuf) {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("flights");
    fs::create_dir(&folder).unwrap();
    flights::copy(flights::small().path(), &folder);
    (outer, folder)
}

/// Files come into the folder under plain names, whole, and none in the place of another.
#[test]
fn nothing_is_put_outside_of_the_folder_or_over_a_file() {
    let (outer, folder) = flights_in_a_folder();
    let lab = Lab::start(&folder);
    let before = lab.state();
    let visitor = lab.visitor();
    let send = |name: &str, text: &str| {
        let request = visitor.post(&format!("/api/upload?name={name}"), text).with_origin(&lab);
        request.with("Content-Type", "application/octet-stream").send(&lab)
    };
    let old = fs::read(folder.join("A.csv")).unwrap();
    for name in [
        "..%2Fx.csv",
        "%2Ftmp%2Fx.csv",
        "lab%2Fstate.json",
        "..",
        "",
        ".x.csv",
        "x%00.csv",
        "a%0Ab.csv",
        "A.csv",
    ] {
        assert_refused(&send(name, "t,x\n0,1\n"), name);
    }
    assert_refused(&send("tool.sh", "#!/bin/sh\n"), "a program");
    let unasked = visitor.post("/api/upload?name=x.csv", "t\n").with_origin(&lab);
    assert_refused(&unasked.with("Content-Type", "multipart/form-data").send(&lab), "a form");
    // A connection that ends early: what was sent of it is gone.
    let long = visitor.post("/api/upload?name=half.csv", "t,x\n").with_origin(&lab);
    long.with("Content-Type", "application/octet-stream").with("Content-Length", "1000").send_and_leave(&lab);
    let start = std::time::Instant::now();
    while fs::read_dir(folder.join("lab")).unwrap().count() > 1 {
        assert!(start.elapsed().as_secs() < 10, "half a file stays");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert_eq!(send("new.csv", "t,x\n0,1\n").status, 200);
    let mut names: Vec<String> = fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let flights = ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv", "lab", "new.csv", "vehicle.toml"];
    assert_eq!(names, flights);
    assert_eq!(fs::read_dir(folder.join("lab")).unwrap().count(), 1, "the lock alone");
    assert_eq!(fs::read_dir(outer.path()).unwrap().count(), 1);
    assert_eq!(fs::read(folder.join("A.csv")).unwrap(), old);
    assert_eq!(before["flights"].as_array().map(Vec::len), Some(5));
    // It is no flight, and says so once the folder is read again.
    assert_eq!(visitor.post("/api/read", "{}").with_origin(&lab).send(&lab).status, 200);
    let state = lab.state();
    let new = state["flights"].as_array().unwrap().iter().find(|flight| flight["name"] == "new.csv").unwrap();
    assert!(new["problem"].as_str().is_some_and(|problem| problem.contains("new.csv")), "{new}");
}

/// A link in the folder is followed within it alone: what it leads to elsewhere is neither shown nor changed.
#[test]
fn no_link_leads_out_of_the_folder() {
    let (outer, folder) = flights_in_a_folder();
    let out = |name: &str| outer.path().join(name);
    let link = |to: PathBuf, name: &str| {
        let _ = fs::remove_file(folder.join(name));
        symlink(to, folder.join(name)).unwrap();
    };
    let measured = fs::read_to_string(folder.join("vehicle.toml")).unwrap();
    fs::rename(folder.join("B.csv"), out("B.csv")).unwrap();
    fs::write(out("vehicle.toml"), &measured).unwrap();
    fs::write(out("A.use.toml"), "use = [[1.0, 20.0]]\n").unwrap();
    fs::create_dir(out("effects")).unwrap();
    link(out("B.csv"), "B.csv");
    fs::create_dir(folder.join("kept")).unwrap();
    fs::rename(folder.join("C.csv"), folder.join("kept/C.csv")).unwrap();
    link("kept/C.csv".into(), "C.csv");
    let lab = Lab::start(&folder);
    let visitor = lab.visitor();
    let post = |path: &str, body: &str| visitor.post(path, body).with_origin(&lab).send(&lab);
    let is_told = |problem: &serde_json::Value| {
        problem.as_str().is_some_and(|why| why.contains("leads out of the folder"))
    };
    let state = lab.state();
    let problem_of = |name: &str| {
        state["flights"].as_array().unwrap().iter().find(|flight| flight["name"] == name).unwrap()["problem"]
            .clone()
    };
    assert!(is_told(&problem_of("B.csv")), "{state}");
    assert!(problem_of("C.csv").is_null(), "a link within the folder is followed: {state}");
    lab.identify();
    assert_refused(&visitor.get("/api/series?model=1&flight=B.csv&from=0&to=1&width=10").send(&lab), "B.csv");

    link(out("A.use.toml"), "A.use.toml");
    assert_refused(&post("/api/use", r#"{"name":"A.csv","parts":[[2,9]]}"#), "parts");
    let fields = visitor.get("/api/vehicle").send(&lab).json()["fields"].clone();
    link(out("vehicle.toml"), "vehicle.toml");
    assert_refused(&post("/api/vehicle", &fields.to_string()), "a vehicle");
    link(out("new.csv"), "new.csv");
    let upload = visitor.post("/api/upload?name=new.csv", "t,x\n0,1\n").with_origin(&lab);
    assert_refused(&upload.with("Content-Type", "application/octet-stream").send(&lab), "an upload");
    fs::rename(folder.join("lab/state.json"), out("state.json")).unwrap();
    link(out("state.json"), "lab/state.json");
    assert_refused(&post("/api/notes", r#"{"flight":"A.csv","text":"secret"}"#), "a state");
    link(out("effects"), "lab/effects");
    let own = serde_json::json!({ "text": effect("good", "-k * u") });
    assert_refused(&post("/api/effects/keep", &own.to_string()), "effects");
    assert_refused(&post("/api/demo", "{}"), "flights to try");
    assert_eq!(post("/api/read", "{}").status, 200);
    let started = std::time::Instant::now();
    while lab.state()["reading"] == true && started.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert!(is_told(&lab.state()["problem"]), "a vehicle file: {}", lab.state());

    // Nor does it begin with such a folder of its own.
    lab.cut();
    let refuses = |what: &str| {
        let ended = output(command(&folder));
        let said = String::from_utf8_lossy(&ended.stderr).trim().to_owned();
        assert_eq!(ended.status.code(), Some(2), "{what}: {said}");
        assert!(said.contains("leads out of the folder") && said.lines().count() == 1, "{what}: {said}");
    };
    refuses("a state");
    fs::remove_dir_all(folder.join("lab")).unwrap();
    link(out("effects"), "lab");
    refuses("all that is kept");

    assert_eq!(fs::read_to_string(out("vehicle.toml")).unwrap(), measured);
    assert_eq!(fs::read_to_string(out("A.use.toml")).unwrap(), "use = [[1.0, 20.0]]\n");
    assert!(!fs::read_to_string(out("state.json")).unwrap().contains("secret"));
    assert_eq!(fs::read_dir(out("effects")).unwrap().count(), 0);
    assert!(!out("new.csv").exists());
}

/// Which parts are used is written beside a flight that is there, or not at all.
#[test]
fn parts_and_notes_are_of_flights_of_the_folder() {
    let (outer, folder) = flights_in_a_folder();
    fs::copy(folder.join("A.csv"), outer.path().join("A.csv")).unwrap();
    let mut lab = Lab::start(&folder);
    let before = lab.state();
    let visitor = lab.visitor();
    let post = |path: &str, body: &str| visitor.post(path, body).with_origin(&lab).send(&lab);
    for name in [
        "../A.csv",
        "/etc/passwd",
        "",
        "..",
        "lab/state.json",
        "B.csv/../A.csv",
        "A",
        "vehicle.toml",
        "A.csv\0",
    ] {
        let name = serde_json::json!(name);
        for (path, body) in [
            ("/api/use", format!(r#"{{"name":{name},"parts":[[2,9]]}}"#)),
            ("/api/use", format!(r#"{{"name":{name},"parts":null}}"#)),
            ("/api/notes", format!(r#"{{"flight":{name},"text":"x"}}"#)),
        ] {
            assert_refused(&post(path, &body), &body);
        }
    }
    for parts in [
        "[]",
        "[[9,2]]",
        "[[2,2]]",
        "[[2]]",
        "[[2,3,4]]",
        "[2,9]",
        "[[\"2\",9]]",
        "[[2,null]]",
        "[[NaN,9]]",
        "[[2,1e999]]",
        "[[-1e308,1e308]]",
        "[[2,900]]",
        "[[-5,9]]",
        "[[2,9],[8,12]]",
        "{}",
        "\"all\"",
        "[[5.0,5.2]]",
    ] {
        assert_refused(&post("/api/use", &format!(r#"{{"name":"A.csv","parts":{parts}}}"#)), parts);
    }
    let many = format!("[{}]", vec!["[2,3]"; 100_000].join(","));
    assert_refused(&post("/api/use", &format!(r#"{{"name":"A.csv","parts":{many}}}"#)), "many parts");
    assert_refused(&post("/api/use", r#"{"name":"A.csv"}"#), "no word of parts");
    let long = serde_json::json!({ "flight": "A.csv", "text": "x".repeat(4001) }).to_string();
    for body in [
        r#"{"flight":"A.csv"}"#,
        r#"{"text":"x"}"#,
        r#"{"model":1,"text":"x"}"#,
        r#"{"flight":"A.csv","text":["x"]}"#,
        &long,
    ] {
        assert_refused(&post("/api/notes", body), &body[..30.min(body.len())]);
    }
    let names = |folder: &std::path::Path| {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names(outer.path()), ["A.csv", "flights"]);
    assert_eq!(names(&folder), ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv", "lab", "vehicle.toml"]);
    assert_eq!(lab.state()["flights"], before["flights"]);
    // The twin: what is right is written.
    let answer = post("/api/use", r#"{"name":"A.csv","parts":[[2,9.0004]]}"#);
    assert_eq!(answer.status, 200, "{}", answer.body);
    let text = fs::read_to_string(folder.join("A.use.toml")).unwrap();
    assert!(text.starts_with("use = [[2.0, 9.0]]"), "{text}");
    let answer = post("/api/notes", r#"{"flight":"A.csv","text":"x"}"#);
    assert_eq!(answer.status, 200, "{}", answer.body);
    assert_eq!(lab.state()["flights"][0]["note"], "x");
    lab.is_alive().unwrap();
}

/// Not one of them ends the server, and each is told what is wrong.
#[test]
fn nonsense_is_refused_and_the_server_stays() {
    let folder = flights::small();
    let mut lab = Lab::start(folder.path());
    lab.identify();
    let visitor = lab.visitor();
    for query in [
        "/api/model",
        "/api/model?id=",
        "/api/model?id=99",
        "/api/model?id=-1",
        "/api/model?id=x",
        "/api/model?id=1e99",
        "/api/diagnosis?model=99",
        "/api/why?model=1&effect=magic",
        "/api/why?model=99&effect=ground-effect",
        "/api/residual?model=1&axis=x&quantity=height",
        "/api/residual?model=1&axis=u&quantity=magic",
        "/api/spectrum?model=1&flight=none.csv&axis=u",
        "/api/none",
        "/page/none.js",
        "/api/download/model.toml?id=99",
        "/api/download/passwd?id=1",
    ] {
        assert_refused(&visitor.get(query).send(&lab), query);
    }
    for window in [
        "from=nan&to=inf&width=10",
        "from=9&to=1&width=0",
        "from=0&to=60&width=18446744073709551615",
        "from=-1e300&to=1e300",
        "from=0&to=60&width=100&ahead=100000",
    ] {
        let answer = visitor.get(&format!("/api/series?model=1&flight=A.csv&{window}")).send(&lab);
        assert!(
            answer.body.len() < 10_000_000 && !answer.body.contains("bug"),
            "{window}: {}",
            answer.status
        );
        answer.json();
    }
    for (path, body) in [
        ("/api/sets", "{"),
        ("/api/sets", ""),
        ("/api/sets", r#"{"name":"A.csv","set":"everything"}"#),
        ("/api/sets", r#"{"name":"none.csv","set":"train"}"#),
        ("/api/current", r#"{"model":99}"#),
        ("/api/jobs", r#"{"do":"format the disk"}"#),
        ("/api/jobs", r#"{"do":"diagnose"}"#),
    ] {
        assert_refused(&visitor.post(path, body).with_origin(&lab).send(&lab), &format!("{path} {body}"));
    }
    for job in
        [r#"{"do":"add","model":99,"effect":"ground-effect"}"#, r#"{"do":"add","model":1,"effect":"magic"}"#]
    {
        visitor.post("/api/jobs", job).with_origin(&lab).send(&lab);
        assert_eq!(lab.state()["models"].as_array().map(Vec::len), Some(1), "{job}");
    }
    let deep = "[".repeat(200_000);
    assert_refused(&visitor.post("/api/sets", &deep).with_origin(&lab).send(&lab), "a deep body");
    let large = format!(r#"{{"name":"{}","set":"train"}}"#, "A".repeat(20_000_000));
    let answer = visitor.post("/api/sets", &large).with_origin(&lab).send(&lab);
    assert_eq!(answer.status, 413, "20 MB: {}", answer.body);
    let [_, most_kb] = lab.memory_kb();
    assert!(most_kb < 1_000_000, "five flights of 24 s and nonsense take {most_kb} kB");
    lab.is_alive().unwrap();
    assert_eq!(visitor.get("/api/state").send(&lab).status, 200);
}

/// An effect as its user writes it.
fn effect(id: &str, formula: &str) -> String {
    format!(
        "[[effect]]\nid = \"{id}\"\nacceleration.u = \"{formula}\"\n\
         coefficient = [{{ name = \"k\", unit = \"1/s\", possible = [-1.0, 1.0], typical = 0.1 }}]\n"
    )
}

/// No text of an effect does more than its formulas say, and each that cannot be right is refused with a sentence.
#[test]
fn texts_of_effects_write_one_file_at_most() {
    let folder = flights::small();
    let mut lab = Lab::start(folder.path());
    lab.identify();
    let visitor = lab.visitor();
    let post = |path: &str, body: serde_json::Value| {
        visitor.post(&format!("/api/effects/{path}"), &body.to_string()).with_origin(&lab).send(&lab)
    };
    let good = effect("good", "-k * u");
    for (what, text) in [
        ("a path as id", effect("../../good", "-k * u")),
        ("a path of Windows", effect(r"..\\good", "-k * u")),
        ("an absolute path", effect("/tmp/good", "-k * u")),
        ("an id with a null", effect("good\\u0000", "-k * u")),
        ("markup as id", effect("<img src=x onerror=alert(1)>", "-k * u")),
        ("markup as formula", effect("good", "<script>alert(1)</script>")),
        ("an effect of the catalogue", effect("tether", "-k * u")),
        ("deep brackets", effect("good", &"(".repeat(60_000))),
        ("deep tables", format!("effect = {}", "[".repeat(60_000))),
        ("deep keys", format!("effect{} = 1", ".a".repeat(30_000))),
        ("too long a text", format!("{good}# {}", "x".repeat(500_000))),
        ("two effects", format!("{good}{}", effect("other", "k * v"))),
        ("no effect", "effect = []".to_owned()),
        ("nothing", String::new()),
        ("no table", "\u{0}\u{feff}<svg onload=alert(1)>".to_owned()),
    ] {
        let checked = post("check", serde_json::json!({ "text": text }));
        assert_eq!(checked.status, 200, "{what}: {}", checked.body);
        let told = checked.json()["problem"].as_str().unwrap_or_default().to_owned();
        assert!(told.len() > 10 && told.len() < 2000 && told.lines().count() == 1, "{what}: {told:?}");
        assert_refused(&post("keep", serde_json::json!({ "text": text })), what);
        assert_refused(&post("try", serde_json::json!({ "text": text, "model": 1 })), what);
        let of_flight = serde_json::json!({ "text": text, "model": 1, "flight": "A.csv" });
        assert_refused(&post("preview", of_flight), what);
    }
    for id in ["../state", "../../A", "/etc/passwd", "", "good", "..", "good\0"] {
        assert_refused(&post("remove", serde_json::json!({ "id": id })), id);
    }
    for body in [
        serde_json::json!({ "text": good, "model": 1, "flight": "../../etc/passwd" }),
        serde_json::json!({ "text": good, "model": 99, "flight": "A.csv" }),
        serde_json::json!({ "text": [good], "model": 1, "flight": "A.csv" }),
    ] {
        assert_refused(&post("preview", body.clone()), &body.to_string());
    }
    let huge = post("keep", serde_json::json!({ "text": "x".repeat(20_000_000) }));
    assert_eq!(huge.status, 413, "{}", huge.body);
    assert!(!folder.path().join("lab/effects").exists(), "something was kept");
    // The twin: what is right is kept, in one file.
    assert_eq!(post("keep", serde_json::json!({ "text": good })).status, 200);
    let kept: Vec<_> = fs::read_dir(folder.path().join("lab/effects")).unwrap().collect();
    assert_eq!(kept.len(), 1);
    assert_eq!(fs::read_to_string(folder.path().join("lab/effects/good.toml")).unwrap(), good);
    lab.is_alive().unwrap();
}

#[test]
fn a_second_server_on_the_folder_is_refused_with_a_sentence() {
    let folder = flights::small();
    let mut lab = Lab::start(folder.path());
    let second = output(command(folder.path()));
    let said = String::from_utf8_lossy(&second.stderr).trim().to_owned();
    assert_eq!(second.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.contains(&folder.path().display().to_string()), "{said}");
    lab.is_alive().unwrap();
    // What it leaves behind when it is killed locks nobody out.
    lab.cut();
    let again = Lab::start(folder.path());
    assert_eq!(again.visitor().get("/api/state").send(&again).status, 200);
}

/// In the browser: a name is text, whatever it looks like.
#[test]
fn a_name_of_a_flight_is_never_a_part_of_the_page() {
    if missing() {
        return;
    }
    let name = "<img src=x onerror=alert(1)>.csv";
    let folder = flights::small();
    fs::rename(folder.path().join("A.csv"), folder.path().join(name)).unwrap();
    let vehicle = folder.path().join("vehicle.toml");
    let text = fs::read_to_string(&vehicle).unwrap();
    let craft = "<script>document.title='taken'</script><b id=taken>";
    let named = text
        .lines()
        .map(|line| if line.starts_with("name =") { format!("name = \"{craft}\"") } else { line.to_owned() });
    fs::write(&vehicle, named.collect::<Vec<_>>().join("\n")).unwrap();
    let (_lab, browser) = crate::page::opened("names", folder.path());
    browser.wait_for(".flight", name);
    let taken = "return document.querySelectorAll('.flight img, #taken, [onerror]').length + (document.title === 'taken' ? 1 : 0)";
    let assert_free =
        |when: &str| assert_eq!(browser.run(taken, 0), 0, "{when}: a name became a part of the page");
    assert_free("at first");
    crate::page::identify(&browser);
    crate::page::diagnose(&browser);
    for tab in ["time", "where", "spectrum", "path", "model", "own"] {
        browser.click(&format!("[role=tab][data-tab={tab}]"));
        browser.settle();
        assert_free(tab);
    }
    browser.finish(&[]);
}
