//! How large the first cache is.

use std::sync::OnceLock;

/// Bytes of the first data cache of the processor that asks first; `None` if it does not tell.
pub fn first_cache_bytes() -> Option<usize> {
    static BYTES: OnceLock<Option<usize>> = OnceLock::new();
    *BYTES.get_or_init(read)
}

/// By the leaf of `cpuid` in which a processor lists its caches: 4 (Intel), or 0x8000001d (AMD), in the same form.
#[cfg(target_arch = "x86_64")]
fn read() -> Option<usize> {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    const DATA: u32 = 1;
    const LEVEL_1: u32 = 1 << 5;
    const CACHES: usize = 8;
    let last = |range: u32| __cpuid(range).eax;
    let leaves = [(0, 4), (0x8000_0000, 0x8000_001d)];
    let known = leaves.into_iter().filter(|&(range, leaf)| last(range) >= leaf).map(|(_, leaf)| leaf);
    known
        .flat_map(|leaf| (0..CACHES as u32).map(move |i| __cpuid_count(leaf, i)))
        .find(|cache| cache.eax & 0xff == DATA | LEVEL_1)
        .map(|cache| {
            let [line, parts, ways] = [0, 12, 22].map(|shift| (cache.ebx >> shift) as usize);
            ((line & 0xfff) + 1) * ((parts & 0x3ff) + 1) * ((ways & 0x3ff) + 1) * (cache.ecx as usize + 1)
        })
}

#[cfg(not(target_arch = "x86_64"))]
fn read() -> Option<usize> {
    None
}

#[cfg(test)]
mod tests {
    use super::first_cache_bytes;

    #[test]
    fn it_is_a_size_that_linux_tells() {
        let cores = std::fs::read_dir("/sys/devices/system/cpu").into_iter().flatten().flatten();
        let caches = cores.map(|core| core.path().join("cache/index0"));
        let read = |file: std::path::PathBuf| std::fs::read_to_string(file).unwrap_or_default().trim().to_string();
        let data = caches.filter(|cache| read(cache.join("type")) == "Data");
        // (Cores may differ.)
        let told: Vec<String> = data.map(|cache| read(cache.join("size"))).collect();
        match first_cache_bytes() {
            Some(bytes) if !told.is_empty() => {
                assert!(told.contains(&format!("{}K", bytes >> 10)), "{bytes}: {told:?}")
            }
            _ => eprintln!("skipped: nothing to compare with"),
        }
    }
}
