//! Helpers shared by the claim tests.
