// Traces the rays of the module random_rays_wasm and prints what they hit, as the program
// random_rays does: node rays.mjs MODULE WORLDS

import { readFile } from "node:fs/promises";

const [path, worlds] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(await readFile(path), {});
const { trace, rays, hits, digest } = instance.exports;
trace(Number(worlds));
const unsigned = (number) => BigInt.asUintN(64, number);
const hash = unsigned(digest()).toString(16).padStart(16, "0");
console.log(`${unsigned(rays())} ${unsigned(hits())} ${hash}`);
