//! One file a subcommand: its options, what it runs, what it prints and writes.

pub(crate) mod add;
pub(crate) mod campaign;
pub(crate) mod campaign_submit;
pub(crate) mod compare;
pub(crate) mod demo;
pub(crate) mod design;
pub(crate) mod design_check;
pub(crate) mod design_report;
pub(crate) mod diagnose;
pub(crate) mod discover;
pub(crate) mod effects;
pub(crate) mod excite;
pub(crate) mod explain;
pub(crate) mod export;
pub(crate) mod ground;
pub(crate) mod identify;
pub(crate) mod import;
pub(crate) mod init;
pub(crate) mod lab;
pub(crate) mod linearize;
pub(crate) mod motor_map;
pub(crate) mod plan;
pub(crate) mod reference;
pub(crate) mod reference_effects;
pub(crate) mod reference_schemas;
pub(crate) mod simulated_laboratory;
