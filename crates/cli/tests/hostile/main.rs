//! Broken and hostile files. Each must end quickly in a picture without NaN or in an error message,
//! in bounded memory, and never in a panic. Files are read and rendered in this process, which is
//! faster; limits are tested with the real command.

mod collection;
mod costs;
mod found;
mod graph;
mod limits;
mod mutate;
mod mutation;
mod promise;
mod render;
mod seeds;
mod smoke;
mod subjects;
mod watch;
