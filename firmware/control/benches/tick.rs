//! Speed of one control tick.
fn main() {
    divan::main();
}
