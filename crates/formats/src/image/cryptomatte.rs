//! Cryptomatte: the coverage of each pixel by each object or material, for mattes in a compositor
//! (Friedman and Jones, Cryptomatte Specification 1.2, Psyop, 2018).
//!
//! Each name is identified by its hash. The largest shares of a pixel come first, two ranks per
//! layer, and a manifest in the file's metadata lists the names.

use snell_scene::Layer;
use std::collections::BTreeMap;

/// Ranks kept per pixel: the customary number.
const RANKS: usize = 6;

/// Layers and metadata for one kind, such as objects.
#[derive(Clone, Debug)]
pub struct Cryptomatte {
    /// Layers of two ranks each: hash, share, hash, share.
    pub layers: Vec<Layer>,
    /// Metadata that a compositor needs.
    pub metadata: Vec<(String, String)>,
}

/// Encodes coverage. `pixels` has, for each pixel in row order, pairs of an index into `names` and
/// the share that the named object covers (0 to 1). Several pairs with one name are added. `kind`
/// names the layers, such as `CryptoObject`.
pub fn encode<'a>(
    kind: &str,
    names: &[String],
    pixels: impl Iterator<Item = &'a [(usize, f32)]>,
) -> Cryptomatte {
    let hashes: Vec<u32> = names.iter().map(|name| hash(name)).collect();
    let mut layers: Vec<Layer> = (0..RANKS / 2)
        .map(|number| Layer {
            name: format!("{kind}{number:02}"),
            // The names are in lower case, so that readers do not take the channels for colours.
            channels: ["r", "g", "b", "a"].map(String::from).to_vec(),
            values: Vec::new(),
        })
        .collect();
    let mut ranked: Vec<(u32, f32)> = Vec::new();
    for pixel in pixels {
        ranked.clear();
        for &(thing, share) in pixel {
            let hash = hashes[thing];
            match ranked.iter_mut().find(|r| r.0 == hash) {
                Some(rank) => rank.1 += share,
                None => ranked.push((hash, share)),
            }
        }
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        ranked.resize(RANKS, (0, 0.0));
        for (layer, pair) in layers.iter_mut().zip(ranked.chunks(2)) {
            layer
                .values
                .extend(pair.iter().flat_map(|&(hash, share)| [f32::from_bits(hash), share]));
        }
    }
    let manifest: BTreeMap<&String, String> =
        names.iter().zip(&hashes).map(|(n, h)| (n, format!("{h:08x}"))).collect();
    let key = &format!("{:08x}", hash(kind))[..7];
    let entry = |name: &str, value: String| (format!("cryptomatte/{key}/{name}"), value);
    let metadata = vec![
        entry("name", kind.to_string()),
        entry("hash", "MurmurHash3_32".into()),
        entry("conversion", "uint32_to_float32".into()),
        entry("manifest", serde_json::to_string(&manifest).unwrap_or_default()),
    ];
    Cryptomatte { layers, metadata }
}

/// Hashes a name. The bits are a normal number when read as a float.
fn hash(name: &str) -> u32 {
    // Reading from memory does not fail.
    let hash = murmur3::murmur3_32(&mut name.as_bytes(), 0).unwrap_or_default();
    match hash >> 23 & 255 {
        0 | 255 => hash ^ 1 << 23,
        _ => hash,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_the_hashes_of_the_specification() {
        // These hashes are from the manifests of the specification's sample pictures.
        assert_eq!(format!("{:08x}", hash("bunny")), "13851a76");
        assert_eq!(format!("{:08x}", hash("default")), "42c9679f");
    }

    #[test]
    fn no_hash_is_infinite_or_not_a_number() {
        assert!((0..100_000).all(|i| f32::from_bits(hash(&format!("thing {i}"))).is_normal()));
    }

    #[test]
    fn shares_are_ranked_and_things_of_one_name_are_one() {
        let names = ["a", "b", "b", "c"].map(String::from);
        let pixel = [(0, 0.2), (1, 0.15), (2, 0.15), (3, 0.5)];
        let matte = encode("CryptoObject", &names, [&pixel[..], &[]].into_iter());
        let ranks: Vec<f32> = matte.layers.iter().flat_map(|l| l.values[..4].to_vec()).collect();
        assert_eq!([ranks[0], ranks[2], ranks[4]].map(f32::to_bits), ["c", "b", "a"].map(hash));
        assert_eq!([ranks[1], ranks[3], ranks[5], ranks[7]], [0.5, 0.3, 0.2, 0.0]);
        assert!(
            matte.layers.iter().all(|l| l.values[4..] == [0.0; 4]),
            "nothing covers the second pixel"
        );
        assert_eq!(matte.metadata[3].1.matches(':').count(), 3, "{:?}", matte.metadata);
    }
}
