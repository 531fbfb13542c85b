//! Quantities into flights: airborne parts on one time grid.
