//! A camera and a sky for scenes that have none.
