//! `snell compare`: how far two pictures are apart.
