//! What the list of effects becomes: the enum of all effects, and code that goes through them one after the other without
//! a loop or a call, because it runs at every sample of every flight.

/// Declares the effects' files, [`Effect`](super::Effect) and [`Adjustments`](super::Adjustments).
macro_rules! catalogue {
    (columns { $($linear:ident => $linear_file:ident),* $(,)? } adjusting { $($other:ident => $other_file:ident),* $(,)? }) => {
        $(mod $linear_file;)*
        $(pub(crate) mod $other_file;)*

        /// A physical effect: one term of the equations of motion, or something that changes what the terms see.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Effect {
            $(#[doc = concat!("See `", stringify!($linear_file), ".rs`.")] $linear,)*
            $(#[doc = concat!("See `", stringify!($other_file), ".rs`.")] $other,)*
            /// Defined by a user, in a file.
            User(User),
        }

        /// Places in the catalogue.
        enum Place { $($linear,)* $($other,)* }

        /// Every effect known beforehand, the basic model's first.
        pub const CATALOGUE: &[Effect] = &[$(Effect::$linear,)* $(Effect::$other,)*];

        impl Effect {
            /// What the effect says of itself.
            pub const fn info(self) -> &'static EffectInfo {
                match self {
                    $(Effect::$linear => &$linear_file::INFO,)*
                    $(Effect::$other => &$other_file::INFO,)*
                    Effect::User(user) => user.info(),
                }
            }

            /// Place in the catalogue; none for a user's.
            pub(crate) const fn place(self) -> Option<usize> {
                match self {
                    $(Effect::$linear => Some(Place::$linear as usize),)*
                    $(Effect::$other => Some(Place::$other as usize),)*
                    Effect::User(_) => None,
                }
            }

            /// Hands the effect's columns at `sample` to `sink`; nothing for an adjusting effect.
            #[inline]
            pub fn columns(self, sample: &Sample, sink: &mut impl Sink) {
                match self {
                    $(Effect::$linear => $linear_file::columns(sample, sink),)*
                    $(Effect::$other => {})*
                    Effect::User(user) => user.columns(sample, sink),
                }
            }
        }

        /// Hands the columns of the linear effects that `which` picks to `sink`. Straight-line code over the catalogue: `columns`
        /// is inlined with its effect's own place, and what no effect looks at is never computed.
        #[inline(always)]
        pub(crate) fn each_linear(sample: &Sample, which: impl Fn(Effect) -> bool, sink: &mut impl PlacedSink) {
            $(if which(Effect::$linear) {
                sink.begin(Place::$linear as usize);
                $linear_file::columns(sample, sink);
            })*
        }

        /// What the effects of kind [`Kind::Adjusting`] change. Neutral by default.
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct Adjustments {
            $($other_file: $other_file::Adjustment,)*
        }

        impl Adjustments {
            /// Takes up what an effect's coefficients mean, with the reference voltage of the fit, V; nothing for a linear
            /// effect.
            pub(crate) fn take_up(&mut self, effect: Effect, coefficients: &[f64], reference_v: f64) {
                match effect {
                    $(Effect::$linear => {})*
                    $(Effect::$other => {
                        self.$other_file = $other_file::Adjustment::new(coefficients, reference_v);
                    })*
                    Effect::User(_) => {}
                }
            }

            /// What matters of them in flight ([`Self::air_velocity_m_s`], [`Self::thrust_rad2_s2`]) by the coefficients of each, which
            /// `of` gives by its place. Those of an effect that is not there are 0.
            #[inline(always)]
            pub(crate) fn in_flight<const N: usize>(of: impl Fn(usize) -> [f64; N]) -> Self {
                Self { $($other_file: $other_file::Adjustment::new(&of(Place::$other as usize), 0.0),)* }
            }

            /// What each of them changes, where it does not run at every sample.
            pub(super) fn all(&self) -> [&(dyn Adjusting + 'static); ADJUSTING] {
                [$(&self.$other_file),*]
            }

            /// Whether anything stands between the square of a rotor's speed and its thrust.
            pub(super) fn changes_thrust(&self) -> bool {
                false $(|| self.$other_file.changes_thrust())*
            }

            /// Velocity relative to the air, body components, m/s.
            #[inline(always)]
            pub(super) fn air_velocity_m_s(&self, input: &SampleInput) -> Vector3<f64> {
                let velocity_m_s = input.velocity_m_s;
                $(let velocity_m_s = self.$other_file.air_velocity_m_s(velocity_m_s, input);)*
                velocity_m_s
            }

            /// What stands in for the square of a rotor's speed in its thrust, rad^2/s^2.
            #[inline(always)]
            pub(super) fn thrust_rad2_s2(&self, at: &AtRotor) -> f64 {
                let speed_rad_s = at.input.rotor_rad_s[at.rotor];
                let thrust_rad2_s2 = speed_rad_s * speed_rad_s;
                $(let thrust_rad2_s2 = self.$other_file.thrust_rad2_s2(thrust_rad2_s2, speed_rad_s);)*
                // From the last to the first, as results have always been rounded.
                let factors = [$(self.$other_file.thrust_factor(at)),*];
                factors.iter().rev().fold(thrust_rad2_s2, |thrust, factor| thrust * factor)
            }

            /// Rotor speed beyond the motor map's at a battery voltage, rad/s.
            #[inline(always)]
            pub(crate) fn speed_change_rad_s(&self, battery_v: f64) -> f64 {
                0.0 $(+ self.$other_file.speed_change_rad_s(battery_v))*
            }
        }

        /// How many adjusting effects there are.
        const ADJUSTING: usize = CATALOGUE.len() - [$(Effect::$linear),*].len();
    };
}

pub(super) use catalogue;
