//! Worlds in double precision.
