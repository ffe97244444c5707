//! The example `random_rays` as a module for WebAssembly, which has no arguments and prints
//! nothing: `trace` computes, and the other functions say what came out.

use snell_lab::bits::{RAYS_PER_WORLD, random_rays};
use snell_math::simd::Level;
use std::sync::atomic::{AtomicU64, Ordering};

static RAYS: AtomicU64 = AtomicU64::new(0);
static HITS: AtomicU64 = AtomicU64::new(0);
static DIGEST: AtomicU64 = AtomicU64::new(0);

/// Traces the rays of so many worlds. Without memory for a world, no rays are counted.
// SAFETY: no other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn trace(worlds: u32) {
    if let Ok(answers) = random_rays(0..worlds, Level::best()) {
        RAYS.store(u64::from(worlds) * u64::from(RAYS_PER_WORLD), Ordering::Relaxed);
        HITS.store(answers.hits, Ordering::Relaxed);
        DIGEST.store(answers.digest, Ordering::Relaxed);
    }
}

/// The number of rays that were traced.
// SAFETY: no other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn rays() -> u64 {
    RAYS.load(Ordering::Relaxed)
}

/// The number of rays that hit something.
// SAFETY: no other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn hits() -> u64 {
    HITS.load(Ordering::Relaxed)
}

/// The hash of all hits.
// SAFETY: no other function has this name.
#[unsafe(no_mangle)]
pub extern "C" fn digest() -> u64 {
    DIGEST.load(Ordering::Relaxed)
}
