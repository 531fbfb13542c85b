//! Formulas of users: text to something that can be checked and evaluated.
//!
//! Parsing and the order of evaluation are `exmex`'s. What stands before it is a strict scanner: it refuses what people read in two ways
//! and the library in one (`-u^2`, which it takes as `(-u)^2`; `a^b^c`; `a/-b`), bounds length and depth, and says what
//! is wrong and what is known in one line.
//!
//! The same text is parsed twice. Over [`Recorded`] numbers it says which operations it consists of; over [`Traced`] ones, which unit its value has
//! and how the effect's coefficients enter it: a formula is linear when its derivatives with respect to them do not
//! depend on them and it vanishes with them. That is read off its structure (sums of linear terms, linear times free,
//! linear over free), never off numbers, so a formula called linear is linear.
//!
//! Deliberately absent: comparisons, branches, user functions, and state but for `lag`, which is a name to the parser.

use exmex::{Express as _, FlatEx, MatchLiteral};

use crate::user_effects::arithmetic::Operators;
use crate::user_effects::dimension::Dimension;
use crate::user_effects::scanner::{Juxtaposed, Scanner, number_length};
use crate::user_effects::tape::Recorded;
use crate::user_effects::trace::{Entry, Trace, Traced};

/// Numbers with a decimal point and an exponent, as the scanner lets them through.
#[derive(Clone, Debug)]
struct Number;

impl MatchLiteral for Number {
    fn is_literal(text: &str) -> Option<&str> {
        match number_length(text) {
            0 => None,
            length => Some(&text[..length]),
        }
    }
}

/// A formula ready to be checked and evaluated.
#[derive(Debug, Clone)]
pub(super) struct Formula {
    traced: FlatEx<Traced, Operators<Traced>, Number>,
    recorded: Recorded,
    names: Vec<String>,
}

impl Formula {
    /// Parses a formula; whether a name is known is the caller's to check.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        Self::parse_with(text, Juxtaposed::Refused)
    }

    fn parse_with(text: &str, juxtaposed: Juxtaposed) -> Result<Self, String> {
        let clear = Scanner::new(text, juxtaposed).run()?;
        // What the scanner lets through, the library takes; its own words are kept for whatever is left.
        let cannot = |error: exmex::ExError| format!("cannot be read: {error}").replace('\n', " ");
        let expression: FlatEx<Recorded, Operators<Recorded>, Number> =
            FlatEx::parse(&clear).map_err(cannot)?;
        let names = expression.var_names().to_vec();
        let places: Vec<Recorded> = (0..names.len()).map(Recorded::name).collect();
        let recorded = expression.eval(&places).map_err(cannot)?;
        Ok(Self { traced: FlatEx::parse(&clear).map_err(cannot)?, names, recorded })
    }

    /// The names in it, in the order in which values are given.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Unit, and how coefficients enter, from what is known of the names.
    pub(super) fn trace(&self, of: impl Fn(&str) -> Trace) -> Result<Trace, String> {
        let inputs: Vec<Traced> = self.names.iter().map(|name| Traced(Ok(of(name)))).collect();
        self.traced.eval(&inputs).map_err(|error| error.to_string())?.0
    }

    /// The operations that it consists of.
    pub(super) fn recorded(&self) -> &Recorded {
        &self.recorded
    }
}

/// The dimension of a unit such as "N s/m" or "1/(kg m^2)".
pub(super) fn dimension_of(unit: &str) -> Result<Dimension, String> {
    let formula = Formula::parse_with(unit, Juxtaposed::Multiplied)?;
    if let Some(name) = formula.names().iter().find(|name| Dimension::of_unit(name).is_none()) {
        let known = Dimension::known_units();
        return Err(format!("unknown unit \"{name}\"; known are {known} (coherent SI, so no mm or ms)"));
    }
    let trace = formula.trace(|name| Trace {
        dimension: Dimension::of_unit(name).unwrap_or(Dimension::NONE),
        entry: Entry::Free,
        // So that any other number shows.
        value: Some(1.0),
    })?;
    if trace.value.is_some_and(|value| value != 1.0) {
        return Err("is a number; a unit without dimension is \"1\"".into());
    }
    Ok(trace.dimension)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::user_effects::scanner::MAX_LENGTH;
    use crate::user_effects::tape::value_of;
    use proptest::prelude::*;

    fn value(text: &str) -> f64 {
        let formula = Formula::parse(text).unwrap_or_else(|why| panic!("{text}: {why}"));
        // a, b, c, ... are 1, 2, 3, ...
        let inputs: Vec<f64> =
            formula.names().iter().map(|n| f64::from(n.as_bytes()[0] - b'a' + 1)).collect();
        value_of(formula.recorded(), &inputs)
    }

    #[test]
    fn formulas_mean_what_people_mean() {
        for (text, expected) in [
            ("-b^2", -4.0),
            ("-b^2*c", -12.0),
            ("c - -1", f64::NAN),
            ("c - (-1)", 4.0),
            ("2 - 3 + 4", 3.0),
            ("2 / 4 * 8", 4.0),
            ("8 / 4 / 2", 1.0),
            ("2 * 3 ^ 2", 18.0),
            ("1.5e-1 * 1E1", 1.5),
            ("max(a, min(b, c))", 2.0),
            ("min(max(a - 5, -c), b*1)*2", -6.0),
            ("sqrt(c^2 + d^2)", 5.0),
            ("atan2(a, 0 - a) * 4", 3.0 * std::f64::consts::PI),
            ("abs(-c) + sign(-c) * exp(0) + ln(1)", 2.0),
            ("sin(b * 0.5 * 0.25)", 0.25_f64.sin()),
            ("exp(-(a + 0.5 + 0.25))", (-1.75_f64).exp()),
            ("10 * step(c) + step(-c) + 100 * step(a - a)", 110.0),
            ("minimum + maxim + sinx", 13.0 + 13.0 + 19.0),
            ("2^(-1)", 0.5),
            ("(2^3)^2", 64.0),
        ] {
            if expected.is_nan() {
                assert!(Formula::parse(text).is_err(), "{text}");
            } else {
                assert!((value(text) - expected).abs() < 1e-12, "{text} is {}", value(text));
            }
        }
    }

    #[test]
    fn what_is_unclear_or_wrong_is_refused_in_one_line() {
        for (text, expected) in [
            ("", "is empty"),
            ("a +", "ends in an operator"),
            ("a b", "operator is missing before \"b\""),
            ("2a", "operator is missing"),
            ("a^b^c", "unclear"),
            ("a / -b", "two operators in a row"),
            ("(a", "not closed"),
            ("a)", "not opened"),
            ("()", "nothing stands before"),
            ("sin a", "write sin(...)"),
            ("f(a)", "\"f\" is not a function; known are sqrt"),
            ("max(a)", "has only one"),
            ("max(a, b, c)", "comma"),
            ("sin(a, b)", "comma"),
            ("a # b", "character '#'"),
            ("{a}", "character '{'"),
            ("\u{3c0}", "character"),
            ("1e999", "too large"),
            ("a ** b", "two operators"),
            ("* a", "nothing stands before"),
            (".5", "character '.'"),
        ] {
            let why = Formula::parse(text).map(|_| ()).unwrap_err();
            assert!(why.contains(expected), "{text}: {why}");
            assert_eq!(why.lines().count(), 1, "{why}");
        }
    }

    #[test]
    fn deep_and_long_text_is_refused_at_once() {
        let deep = format!("{}a{}", "(".repeat(100_000), ")".repeat(100_000));
        let long = "a+".repeat(500_000) + "a";
        for text in [deep.as_str(), &long, &deep[..MAX_LENGTH], &"-".repeat(MAX_LENGTH), &"max(".repeat(100)]
        {
            let started = std::time::Instant::now();
            assert!(Formula::parse(text).is_err());
            assert!(started.elapsed().as_millis() < 50, "{:?}", started.elapsed());
        }
    }

    #[test]
    fn units_of_the_catalogue_are_read() {
        for effect in crate::effects::CATALOGUE {
            for c in effect.info().coefficients {
                dimension_of(c.unit).unwrap_or_else(|why| panic!("{effect} {}: {} {why}", c.name, c.unit));
            }
        }
        for quantity in crate::QUANTITIES {
            dimension_of(quantity.unit).unwrap();
        }
        for (unit, expected) in
            [("N s/m", "kg/s"), ("1/(kg m^2)", "1/(kg m^2)"), ("rad/s/V", "1/(V s)"), ("kg*m^2", "kg m^2")]
        {
            assert_eq!(dimension_of(unit).unwrap().to_string(), expected);
        }
        for (unit, expected) in [
            ("mm", "unknown unit \"mm\""),
            ("1/kg m", "unclear"),
            ("2 m", "is a number"),
            ("m +", "operator"),
        ] {
            let why = dimension_of(unit).unwrap_err();
            assert!(why.contains(expected), "{unit}: {why}");
        }
    }

    /// A unit in commands is the ordinary one where a command is a rad/s, and thrust is an acceleration whatever it is.
    #[test]
    fn units_in_commands_have_the_dimension_of_the_ordinary_ones() {
        let coefficients = crate::effects::CATALOGUE.iter().flat_map(|effect| effect.info().coefficients);
        let quantities = crate::QUANTITIES.iter().chain(crate::COMBINATIONS);
        let both = coefficients
            .map(|c| (c.unit, c.unit_in_commands))
            .chain(quantities.map(|q| (q.unit, q.unit_in_commands)));
        let with = |unit: &str, command: &str| dimension_of(&unit.replace("cmd", command)).unwrap();
        let mut others = 0;
        for (ordinary, in_commands) in both {
            let Some(in_commands) = in_commands else { continue };
            assert!(with(in_commands, "Hz").is(dimension_of(ordinary).unwrap()), "{in_commands}");
            others += 1;
        }
        assert!(others > 30, "{others}");
        // C_T beta sum cmd^2 / m, with kelvin, which nothing else has, for commands.
        let thrust = crate::Effect::Thrust.info().coefficients[0].unit_in_commands.unwrap();
        let acceleration = with(thrust, "K").times(with("kg m cmd^2/kg", "K"));
        assert_eq!(acceleration.to_string(), "m/s^2");
    }

    /// A formula as a tree, its text with as few brackets as the rules ask for, and its value.
    #[derive(Debug, Clone)]
    enum Tree {
        Number(u32),
        Name(u8),
        Negative(Box<Tree>),
        Two(char, Box<Tree>, Box<Tree>),
        Call(&'static str, Box<Tree>),
        CallTwo(&'static str, Box<Tree>, Box<Tree>),
    }

    impl Tree {
        fn text(&self) -> String {
            let strength = |c: char| "+-*/^".find(c).map_or(9, |p| [1, 1, 2, 2, 3][p]);
            let side = |tree: &Tree, at_least: usize| match tree {
                Tree::Two(c, ..) if strength(*c) < at_least => format!("({})", tree.text()),
                Tree::Negative(_) => format!("({})", tree.text()),
                _ => tree.text(),
            };
            match self {
                Tree::Number(n) => format!("{}", f64::from(*n) / 8.0),
                Tree::Name(k) => char::from(b'a' + k).to_string(),
                Tree::Negative(a) => format!("-{}", side(a, 2)),
                Tree::Two('^', a, b) => format!("{}^{}", side(a, 4), side(b, 4)),
                Tree::Two(c, a, b) => format!("{}{c}{}", side(a, strength(*c)), side(b, strength(*c) + 1)),
                Tree::Call(f, a) => format!("{f}({})", a.text()),
                Tree::CallTwo(f, a, b) => format!("{f}({}, {})", a.text(), b.text()),
            }
        }

        fn value(&self) -> f64 {
            match self {
                Tree::Number(n) => f64::from(*n) / 8.0,
                Tree::Name(k) => f64::from(*k) + 1.0,
                Tree::Negative(a) => -a.value(),
                Tree::Two('+', a, b) => a.value() + b.value(),
                Tree::Two('-', a, b) => a.value() - b.value(),
                Tree::Two('*', a, b) => a.value() * b.value(),
                Tree::Two('/', a, b) => a.value() / b.value(),
                Tree::Two(_, a, b) => a.value().powf(b.value()),
                Tree::Call("sin", a) => a.value().sin(),
                Tree::Call(_, a) => a.value().abs(),
                // Unlike the standard library's, ours do not hide what is not a number.
                Tree::CallTwo(_, a, b) if a.value().is_nan() || b.value().is_nan() => f64::NAN,
                Tree::CallTwo("min", a, b) => a.value().min(b.value()),
                Tree::CallTwo(_, a, b) => a.value().max(b.value()),
            }
        }
    }

    fn trees() -> impl Strategy<Value = Tree> {
        let leaf = prop_oneof![(1_u32..40).prop_map(Tree::Number), (0_u8..5).prop_map(Tree::Name)];
        leaf.prop_recursive(4, 24, 2, |inner| {
            let pair = (inner.clone(), inner.clone());
            prop_oneof![
                (prop::sample::select(vec!['+', '-', '*', '/', '^']), pair.clone())
                    .prop_map(|(c, (a, b))| Tree::Two(c, a.into(), b.into())),
                inner.clone().prop_map(|a| Tree::Negative(a.into())),
                (prop::sample::select(vec!["sin", "abs"]), inner).prop_map(|(f, a)| Tree::Call(f, a.into())),
                (prop::sample::select(vec!["min", "max"]), pair).prop_map(|(f, (a, b))| Tree::CallTwo(
                    f,
                    a.into(),
                    b.into()
                )),
            ]
        })
    }

    proptest! {
        #[test]
        fn a_formula_has_the_value_of_its_tree(tree in trees()) {
            let text = tree.text();
            prop_assume!(text.len() <= MAX_LENGTH);
            let (found, expected) = (value(&text), tree.value());
            // Products and quotients may be taken in another order: some roundings of each of 24 operations.
            let near = (found - expected).abs() <= 1e-9 * expected.abs().max(1.0);
            // What is not finite or huge (powers of powers) amplifies roundings without bound.
            prop_assert!(near || !(expected.abs() < 1e6), "{text} is {found}, not {expected}");
        }

        #[test]
        fn any_text_is_parsed_or_refused(text in "\\PC{0,60}") {
            let _ = Formula::parse(&text);
            let _ = dimension_of(&text);
        }

        #[test]
        fn any_mixture_of_tokens_is_parsed_or_refused(
            tokens in prop::collection::vec(
                prop::sample::select(vec![
                    "a", "b", "1", "2.5e3", "+", "-", "*", "/", "^", "(", ")", ",", "sin(", "max(", "atan2(", " ",
                ]),
                0..40,
            )
        ) {
            let text = tokens.concat();
            if let Ok(formula) = Formula::parse(&text) {
                let inputs = vec![1.5; formula.names().len()];
                let _ = value_of(formula.recorded(), &inputs);
                let known = |_: &str| Trace { dimension: Dimension::NONE, entry: Entry::Linear, value: None };
                // Pure numbers everywhere: whatever is parsed has a unit.
                prop_assert!(formula.trace(known).is_ok(), "{text}");
            }
        }
    }
}
