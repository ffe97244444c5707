//! snell
