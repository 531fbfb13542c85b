//! Which crate may use which: the arrows of the architecture, checked against `cargo metadata`.
//!
//! The table below is the only place where an arrow is allowed; ARCHITECTURE.md tells the same in prose.
//! Dev- and build-dependencies count too: a test that needs two crates which do not know each other is a
//! story and belongs into `tests`.

use cargo_metadata::DependencyKind;

use crate::base::workspace::Workspace;

/// What one crate may use of ours, and why no more than that.
struct Allowed {
    from: &'static str,
    to: &'static [&'static str],
    why: &'static str,
}

/// Every crate of the architecture, those that are still to come among them.
const ARROWS: &[Allowed] = &[
    Allowed { from: "fpu", to: &[], why: "an instruction of a processor" },
    Allowed { from: "control", to: &["fpu"], why: "what flies knows neither the plant nor files nor links" },
    Allowed {
        from: "gains-file",
        to: &["control"],
        why: "one reader of gains for the craft, the simulation and the design",
    },
    Allowed { from: "proto", to: &[], why: "both ends of a link share the messages and nothing else" },
    Allowed {
        from: "proto-files",
        to: &["proto"],
        why: "keys are files, and chance is the system's, only where there is one",
    },
    Allowed { from: "plain-line", to: &[], why: "a line of words is the same for all who write one" },
    Allowed { from: "model", to: &[], why: "the plant never sees the controller" },
    Allowed { from: "fourier", to: &[], why: "a transform of numbers" },
    Allowed { from: "pattern", to: &[], why: "who flies a pattern is no part of it" },
    Allowed {
        from: "report",
        to: &["plain-line"],
        why: "pages and plots are drawn from plain numbers and words",
    },
    Allowed {
        from: "flights",
        to: &["model"],
        why: "a log is read without knowing what is made of it, but for the vehicle's motor commands",
    },
    Allowed {
        from: "logs",
        to: &["model", "flights", "proto"],
        why: "logs become flights before anything is fitted to them, and our own recordings hold messages",
    },
    Allowed {
        from: "sysid",
        to: &["model", "flights", "fourier", "report"],
        why: "identification fits the effects that the plant simulates, and its sentences write numbers as tables do",
    },
    Allowed {
        from: "diagnosis",
        to: &["model", "flights", "fourier", "logs", "sysid", "report"],
        why: "what is missing is searched for with the fit and the residuals of identification, and told with numbers as in tables",
    },
    Allowed {
        from: "motor-stand",
        to: &["model", "flights", "sysid"],
        why: "logs of single motors are filtered and fitted as flights are",
    },
    Allowed {
        from: "design",
        to: &["model", "control", "gains-file"],
        why: "gains are designed on the linearised model and judged with the filters that fly",
    },
    Allowed {
        from: "craft",
        to: &["control", "proto"],
        why: "every craft's program turns messages into ticks and ticks into messages the same way",
    },
    Allowed {
        from: "law-c",
        to: &["control", "craft"],
        why: "programs in C get the law alone, with gains as an image",
    },
    Allowed {
        from: "sil",
        to: &[
            "model",
            "craft",
            "control",
            "proto",
            "report",
            "flights",
            "sysid",
            "diagnosis",
            "design",
            "pattern",
        ],
        why: "the loop joins plant and controller, writes flight files, and draws and judges its responses",
    },
    Allowed { from: "table", to: &[], why: "columns of numbers and words mean nothing to it" },
    Allowed {
        from: "fleet",
        to: &["model", "flights", "logs", "sysid", "diagnosis", "report", "table"],
        why: "flights are read, checked and fitted as for one model, and kept as tables",
    },
    Allowed {
        from: "campaign",
        to: &["sil", "design", "model", "control", "proto", "report", "table"],
        why: "many flights of the loop over what a model leaves open, and what came of them",
    },
    Allowed {
        from: "python",
        to: &["quadlab", "sil", "diagnosis", "sysid", "flights", "model"],
        why: "Python runs the program's commands, and gets flights, residuals and simulated craft as arrays",
    },
    Allowed {
        from: "export",
        to: &["craft", "design", "gains-file", "model", "report"],
        why: "other tools get the craft's physical parameters, its linear model and its gains, with numbers as in tables",
    },
    Allowed {
        from: "ground",
        to: &["control", "model", "pattern", "proto", "proto-files", "report", "flights", "logs", "sysid"],
        why: "it speaks to the craft in messages, names what the supervisor says, and leaves flight files as its recordings are read",
    },
    Allowed {
        from: "com",
        to: &["craft", "control", "gains-file", "plain-line", "proto", "proto-files"],
        why: "the craft carries the flight law and a link, and says what is wrong",
    },
    Allowed {
        from: "mcu",
        to: &["craft", "control", "gains-file", "proto", "proto-files"],
        why: "the craft carries the flight law and a link; its key is read when it is built",
    },
    Allowed {
        from: "quadlab",
        to: &[
            "control",
            "model",
            "pattern",
            "proto",
            "report",
            "flights",
            "logs",
            "sysid",
            "diagnosis",
            "motor-stand",
            "design",
            "sil",
            "campaign",
            "fleet",
            "table",
            "export",
            "ground",
        ],
        why: "the user's program joins the libraries",
    },
    Allowed {
        from: "stories",
        to: &[
            "control",
            "craft",
            "model",
            "proto",
            "proto-files",
            "report",
            "flights",
            "logs",
            "sysid",
            "diagnosis",
            "motor-stand",
            "design",
            "sil",
            "campaign",
            "ground",
            "com",
            "mcu",
            "law-c",
            "pattern",
            "gains-file",
            "quadlab",
        ],
        why: "stories go across crates",
    },
    Allowed { from: "xtask", to: &[], why: "the door has to open when a crate behind it does not build" },
];

/// One crate of ours uses another.
pub(crate) struct Edge {
    from: String,
    to: String,
    kind: DependencyKind,
}

/// Every dependency between members: normal, build and dev, on whatever platform or feature.
pub(crate) fn edges(workspace: &Workspace) -> Vec<Edge> {
    let members = workspace.members();
    let is_member = |name: &str| members.iter().any(|member| member.name.as_str() == name);
    let mut edges = Vec::new();
    for member in &members {
        for used in member.dependencies.iter().filter(|used| used.path.is_some() && is_member(&used.name)) {
            edges.push(Edge { from: member.name.to_string(), to: used.name.clone(), kind: used.kind });
        }
    }
    edges
}

/// Checks the workspace's arrows.
pub(crate) fn check(workspace: &Workspace) -> Vec<String> {
    let mut problems: Vec<String> =
        workspace.members().iter().filter_map(|member| unknown_crate(member.name.as_str())).collect();
    problems.extend(edges(workspace).iter().filter_map(refused));
    problems
}

fn unknown_crate(name: &str) -> Option<String> {
    let known = ARROWS.iter().any(|allowed| allowed.from == name);
    (!known).then(|| {
        format!("crate {name} has no line in the table of xtask/src/checks/arrows.rs: add what it may use, and why")
    })
}

fn refused(edge: &Edge) -> Option<String> {
    let Edge { from, to, kind } = edge;
    let allowed = ARROWS.iter().find(|allowed| allowed.from == from)?;
    if allowed.to.contains(&to.as_str()) {
        return None;
    }
    let may = if allowed.to.is_empty() { "nothing of ours".to_owned() } else { allowed.to.join(", ") };
    Some(format!("{from} -> {to} ({kind} dependency): {from} may use {may}, because {}", allowed.why))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edge(from: &str, to: &str, kind: DependencyKind) -> Edge {
        Edge { from: from.into(), to: to.into(), kind }
    }

    #[test]
    fn a_plant_that_sees_the_controller_is_refused_by_name_and_reason() {
        let problem = refused(&edge("model", "control", DependencyKind::Normal)).expect("a bad arrow");
        assert!(problem.contains("model -> control"), "{problem}");
        assert!(problem.contains("the plant never sees the controller"), "{problem}");
    }

    #[test]
    fn an_arrow_for_tests_alone_is_an_arrow() {
        assert!(refused(&edge("control", "model", DependencyKind::Development)).is_some());
        assert!(refused(&edge("sysid", "sil", DependencyKind::Development)).is_some());
        assert!(refused(&edge("report", "model", DependencyKind::Build)).is_some());
    }

    #[test]
    fn allowed_arrows_pass() {
        for (from, to) in [("sysid", "model"), ("sil", "control"), ("quadlab", "sil"), ("stories", "quadlab")]
        {
            assert_eq!(refused(&edge(from, to, DependencyKind::Normal)), None);
        }
    }

    #[test]
    fn a_crate_without_a_line_is_a_problem() {
        assert!(unknown_crate("autopilot").is_some());
        assert_eq!(unknown_crate("control"), None);
    }

    /// The table itself holds together: each crate once, only known crates on the right, and no way back.
    #[test]
    fn the_table_has_no_cycle() {
        let mut placed: Vec<&str> = Vec::new();
        while placed.len() < ARROWS.len() {
            let next = ARROWS.iter().find(|allowed| {
                !placed.contains(&allowed.from) && allowed.to.iter().all(|to| placed.contains(to))
            });
            placed.push(next.expect("an order in which each crate comes after what it uses").from);
        }
    }
}
