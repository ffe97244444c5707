//! Other ray casters in Rust on the rays that `snell bench rays --dump-rays FOLDER` writes.
//!
//! `snell-bench-peers FOLDER... [--threads LIST] [--repeat N]`: for each folder, peer, kind of rays
//! and number of threads one line of JSON, with the fields of `snell bench rays`. Threads take
//! pieces of 4096 rays in turn; medians.

mod npy;
mod peers;

use peers::Peer;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// Rays that a thread takes at a time, as in Snell.
const PIECE: usize = 4096;

type Error = Box<dyn std::error::Error>;

/// Triangles with three corners each.
pub type Triangles = Vec<[[f32; 3]; 3]>;

/// A ray as it is in the files.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: [f32; 3],
    pub t_min: f32,
    pub direction: [f32; 3],
    pub t_max: f32,
}

/// What is asked about a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The distance of the nearest hit, infinite if there is none.
    Closest,
    /// 0 if anything is in the way, otherwise infinite.
    Occluded,
}

fn main() -> Result<(), Error> {
    let (mut folders, mut threads, mut repeat) =
        (Vec::new(), vec![1, rayon::current_num_threads()], 5);
    let mut arguments = std::env::args().skip(1);
    while let Some(word) = arguments.next() {
        match word.as_str() {
            "--threads" => {
                let list = arguments.next().unwrap_or_default();
                threads = list.split(',').map(str::parse).collect::<Result<_, _>>()?;
            }
            "--repeat" => repeat = arguments.next().unwrap_or_default().parse()?,
            _ => folders.push(PathBuf::from(word)),
        }
    }
    if folders.is_empty() {
        return Err("name a folder that `snell bench rays --dump-rays` wrote".into());
    }
    folders.iter().try_for_each(|folder| measure(folder, &threads, repeat))
}

fn measure(folder: &Path, threads: &[usize], repeat: usize) -> Result<(), Error> {
    let positions = npy::floats::<3>(&folder.join("positions.npy"))?;
    let triangles: Triangles = npy::integers::<3>(&folder.join("triangles.npy"))?
        .iter()
        .map(|corners| corners.map(|i| positions[i as usize]))
        .collect();
    for peer in peers::NAMES {
        let start = Instant::now();
        let built = peers::build(peer, &triangles);
        let build_seconds = start.elapsed().as_secs_f64();
        for kind in ["primary", "shadow", "diffuse", "shuffled"] {
            let file = folder.join(format!("{kind}.npy"));
            if !file.exists() {
                continue;
            }
            let to_ray = |r: &[f32; 8]| Ray {
                origin: [r[0], r[1], r[2]],
                t_min: r[3],
                direction: [r[4], r[5], r[6]],
                t_max: r[7],
            };
            let rays: Vec<Ray> = npy::floats::<8>(&file)?.iter().map(to_ray).collect();
            let expected = npy::floats::<1>(&folder.join(format!("{kind}-t.npy")))?;
            let query = if kind == "shadow" { Query::Occluded } else { Query::Closest };
            for &threads in threads {
                let (seconds, found) = trace(&*built, query, &rays, threads, repeat)?;
                let agree = found.iter().zip(&expected).filter(|(a, b)| agrees(**a, b[0])).count();
                println!(
                    "{{\"scene\":\"{}\",\"triangles\":{},\"rays\":\"{kind}\",\"ray_count\":{},\
                     \"threads\":{threads},\"peer\":\"{peer}\",\
                     \"build_seconds\":{build_seconds:.4},\
                     \"mrays_per_second\":{:.4},\"agree\":{:.6}}}",
                    folder.file_name().unwrap_or_default().to_string_lossy(),
                    triangles.len(),
                    rays.len(),
                    rays.len() as f64 / seconds * 1e-6,
                    agree as f64 / rays.len().max(1) as f64
                );
            }
        }
    }
    Ok(())
}

/// Median of the times, and the answers.
fn trace(
    peer: &dyn Peer,
    query: Query,
    rays: &[Ray],
    threads: usize,
    repeat: usize,
) -> Result<(f64, Vec<f32>), Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut found = vec![f32::INFINITY; rays.len()];
    let mut seconds = Vec::new();
    // The first run warms up.
    for _ in 0..=repeat {
        let pieces = Mutex::new(rays.chunks(PIECE).zip(found.chunks_mut(PIECE)));
        let start = Instant::now();
        pool.broadcast(|_| {
            loop {
                let piece = pieces.lock().unwrap_or_else(|e| e.into_inner()).next();
                let Some((rays, found)) = piece else { break };
                peer.trace(query, rays, found);
            }
        });
        seconds.push(start.elapsed().as_secs_f64());
    }
    seconds.remove(0);
    seconds.sort_by(f64::total_cmp);
    Ok((seconds[seconds.len() / 2], found))
}

fn agrees(a: f32, b: f32) -> bool {
    a == b || (a - b).abs() <= 1e-4 * a.abs().max(b.abs())
}
