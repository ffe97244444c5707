// How fast the page without a server is: `node bench/page_speed.mjs [FOLDER]`, after
// `cargo xtask page`. CHROME and SNELL name the programs. It prints the time to the first picture,
// pictures per second while a scene turns, and samples per second beside those of `snell render` on
// one thread; in FOLDER it puts screenshots, moving and at rest. SCENES=fog,hair and SPP=4 choose
// built-in scenes and samples; a mesh of 5 MB on the web comes last.

import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { site } from "../web/tests/alone/server.mjs";

const { chromium } = createRequire(new URL("../web/package.json", import.meta.url))(
  "playwright-core",
);
const SCENES = process.env.SCENES?.split(",") ?? ["cornell-box", "spheres", "teapot", "fog"];
const SPP = Number(process.env.SPP ?? 16);
const VIEWPORT = { width: 1280, height: 720 };
const MOVES = 5000;
const scratch = mkdtempSync(join(tmpdir(), "snell-speed-"));
const shots = process.argv[2];
if (shots) mkdirSync(shots, { recursive: true });

/** A mesh of so many triangles in one file: a square with waves. */
function waves(triangles) {
  const side = Math.round(Math.sqrt(triangles / 2));
  const row = side + 1;
  const points = new Float32Array(row * row * 3);
  const indices = new Uint32Array(side * side * 6);
  for (let i = 0; i < row * row; i++) {
    const [x, z] = [(i % row) / side, Math.floor(i / row) / side];
    points.set([x, 0.05 * Math.sin(25 * x) * Math.cos(31 * z), z], i * 3);
  }
  for (let i = 0, at = 0; i < side * row; i++) {
    if (i % row === side) continue;
    indices.set([i, i + row, i + 1, i + 1, i + row, i + row + 1], at);
    at += 6;
  }
  const json = JSON.stringify({
    asset: { version: "2.0" },
    buffers: [{ byteLength: points.byteLength + indices.byteLength }],
    bufferViews: [
      { buffer: 0, byteLength: points.byteLength },
      { buffer: 0, byteOffset: points.byteLength, byteLength: indices.byteLength },
    ],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: row * row,
        type: "VEC3",
        min: [0, -0.05, 0],
        max: [1, 0.05, 1],
      },
      { bufferView: 1, componentType: 5125, count: indices.length, type: "SCALAR" },
    ],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    nodes: [{ mesh: 0 }],
    scenes: [{ nodes: [0] }],
  });
  const text = Buffer.from(json.padEnd(Math.ceil(json.length / 4) * 4));
  const data = Buffer.concat([Buffer.from(points.buffer), Buffer.from(indices.buffer)]);
  const head = Buffer.alloc(20);
  [0x46546c67, 2, 28 + text.length + data.length, text.length, 0x4e4f534a].forEach((word, i) => {
    head.writeUInt32LE(word, i * 4);
  });
  const chunk = Buffer.alloc(8);
  chunk.writeUInt32LE(data.length, 0);
  chunk.writeUInt32LE(0x004e4942, 4);
  return Buffer.concat([head, text, chunk, data]);
}

/** Notes when the renderer has been loaded, and when the first picture of the scene is shown. */
function watch() {
  window.snellFrames = [];
  const name = decodeURIComponent(/scene=([^&]*)/.exec(location.hash)[1])
    .split("/")
    .at(-1);
  let before = -1;
  const look = () => {
    const [now, frames] = [performance.now(), window.snellFrames.length];
    if (document.title.includes("–")) window.loaded ??= now;
    if (before < 0 && document.title.startsWith(name.split(".")[0])) before = frames;
    const isShown = document.querySelector("canvas[data-frame]") !== null;
    if (before >= 0 && frames > before && isShown) window.first = now;
    else requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}

const rest = (page) =>
  page.waitForFunction(() => document.querySelector(".dot.done"), null, { timeout: 900_000 });

/** Turns the scene for a while; pictures per second, and the median of their sizes and delays. */
async function turn(page, name) {
  await page.evaluate(() => {
    window.snellFrames.length = 0;
  });
  await page.mouse.move(640, 330);
  await page.mouse.down();
  const start = Date.now();
  let isShot = !shots;
  for (let i = 1; Date.now() - start < MOVES; i++) {
    await page.mouse.move(640 + 200 * Math.sin(i / 20), 330 + 20 * Math.sin(i / 33));
    await page.waitForTimeout(15);
    if (!isShot && Date.now() - start > MOVES / 2) {
      isShot = true;
      await page.screenshot({ path: join(shots, `${name}-moving.png`) });
    }
  }
  const frames = await page.evaluate(() => window.snellFrames);
  await page.mouse.up();
  const median = (values) => values.sort((a, b) => a - b)[values.length >> 1] ?? Number.NaN;
  return {
    rate: frames.length / ((Date.now() - start) / 1000),
    scale: median(frames.map((frame) => frame.scale)),
    latency: median(frames.map((frame) => frame.latency)),
  };
}

/** Seconds that a command renders on one thread. */
function native(words) {
  const stats = join(scratch, "stats.json");
  const options = ["--threads", "1", "-q", "--stats", stats, "-o", join(scratch, "picture.exr")];
  execFileSync(process.env.SNELL, ["render", ...words, ...options]);
  return JSON.parse(readFileSync(stats, "utf8")).render_seconds;
}

const served = await site({ "waves.glb": waves(280_000) });
const browser = await chromium.launch({
  executablePath: process.env.CHROME,
  args: ["--no-sandbox", "--disable-gpu"],
});
console.log("scene          loaded   first picture   turning: pictures/s, width, delay   at rest");
for (const named of [...SCENES, "waves.glb"]) {
  const scene = named.endsWith(".glb") ? served.url + named : named;
  const page = await browser.newPage({ viewport: VIEWPORT });
  await page.addInitScript(watch);
  const name = scene.split("/").at(-1);
  await page.goto(`${served.page}#scene=${scene}&spp=${SPP}`);
  await page.waitForFunction(() => window.first > 0, null, { timeout: 120_000 });
  const [loaded, first] = await page.evaluate(() => [window.loaded, window.first]);
  await page.waitForTimeout(1500);
  const { rate, scale, latency } = await turn(page, name);
  await page.waitForTimeout(1000);
  await rest(page);
  if (shots) await page.screenshot({ path: join(shots, `${name}-rest.png`) });
  const words = await page.evaluate(() =>
    [...document.querySelectorAll(".status span")].map((span) => span.textContent),
  );
  const found = (form) => words.find((text) => form.test(text)) ?? "";
  const seconds = Number.parseFloat(found(/^[0-9.]+ s$/));
  const size = found(/×/).split("×").map(Number);
  const samples = (size[0] * size[1] * SPP) / 1e6;
  const later = (first - loaded).toFixed(0);
  console.log(
    `${name.padEnd(12)} ${loaded.toFixed(0).padStart(5)} ms ${later} ms later` +
      `   ${rate.toFixed(1)}, ${Math.round(scale * 100)} %, ${latency.toFixed(0)} ms` +
      `   ${(samples / seconds).toFixed(3)} million samples/s (${seconds} s)`,
  );
  if (!scene.includes("/") && process.env.SNELL) {
    const alone = native([scene, "--spp", String(SPP), "--size", size.join("x")]);
    console.log(
      `  snell render on one thread: ${(samples / alone).toFixed(3)} (${alone.toFixed(1)} s)`,
    );
  }
  await page.close();
}
await browser.close();
served.stop();
