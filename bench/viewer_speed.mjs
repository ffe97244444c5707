// How the viewer moves and comes to rest, as a browser sees it, scene by scene.
//
//   SNELL=target/release/snell CHROME=chromium node bench/viewer_speed.mjs cornell-box a.glb ...
//
// Each scene is opened at 960x540 pixels (SIZE=1280x720), left at rest for REST seconds (4), and
// turned by the mouse for SECONDS (6). Then the hand stops. For each scene it says:
//   first    from the command to the first picture on the page's canvas, browser already running
//   width    pixels across the moving pictures (median), and frames a second
//   latency  from the input to the frame that shows it (median and 95 %)
//   made in  from the begin to the end of rendering a frame (median and 95 %)
//   cpu      processor time of the server for a frame, of all threads, encoding included
//   light    mean difference of the last moving picture to the picture at rest of the same camera,
//            in levels of 255; `blocks` is that of the means of 16x16 pixels, without noise and
//            edges
//   quiet    from the hand's stop to a picture with less than 2 % noise, or a denoised one
//   rest     from the hand's stop to the first picture at rest
//
// THREADS=2 limits the renderer's threads. OPTIONS="--spp 256" are options of `snell render`.
// FINISH=60 is how long the picture at rest may take. SHOTS=folder keeps screenshots.
// RATE=750 sends everything through a line of that many kbit/s.

import { spawn } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { loadavg } from "node:os";
import { basename, join } from "node:path";
import { slowLine } from "./slow_line.mjs";

const { chromium } = createRequire(new URL("../web/package.json", import.meta.url))(
  "playwright-core",
);
const env = process.env;
const SNELL = env.SNELL ?? "snell";
const [WIDTH, HEIGHT] = (env.SIZE ?? "960x540").split("x").map(Number);
const [SECONDS, REST] = [Number(env.SECONDS ?? 6), Number(env.REST ?? 4)];
const FINISH = Number(env.FINISH ?? 60);
const threads = env.THREADS ? ["--threads", env.THREADS] : [];
const options = env.OPTIONS ? ["--", ...env.OPTIONS.split(" ")] : [];

const quantile = (values, q) => {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(sorted.length * q))] ?? Number.NaN;
};

async function serve(scene) {
  const child = spawn(SNELL, ["view", scene, "--no-open", ...threads, ...options], {
    stdio: ["ignore", "pipe", process.env.ERR ? "inherit" : "ignore"],
  });
  const url = await new Promise((resolve, reject) => {
    let text = "";
    child.stdout.on("data", (data) => {
      text += data;
      if (text.includes("\n")) resolve(text.trim());
    });
    child.on("exit", (code) => reject(new Error(`snell view ended with ${code}`)));
  });
  child.removeAllListeners("exit");
  const stop = () =>
    new Promise((resolve) => {
      child.on("exit", resolve);
      child.kill("SIGINT");
    });
  /** Milliseconds of processor time so far; Linux counts in hundredths of a second. */
  const spent = () => {
    const words = readFileSync(`/proc/${child.pid}/stat`, "utf8").split(") ")[1].split(" ");
    return (Number(words[11]) + Number(words[12])) * 10;
  };
  return { url, stop, spent };
}

/** In the page: the hand that turns the scene at the browser's own rate; it stops at a moment. */
function turn(seconds) {
  const stage = document.querySelector(".stage");
  const { left, top, width, height } = stage.getBoundingClientRect();
  const begin = performance.now();
  return new Promise((resolve) => {
    const step = () => {
      const t = (performance.now() - begin) / 1000;
      if (t > seconds) return resolve(performance.now());
      const [clientX, clientY] = [
        left + width / 2 + 60 * Math.sin(t * 1.5),
        top + height / 2 + 15 * Math.sin(t * 2.4),
      ];
      stage.dispatchEvent(
        new PointerEvent("pointermove", {
          pointerId: 1,
          clientX,
          clientY,
          buttons: 1,
          bubbles: true,
        }),
      );
      requestAnimationFrame(step);
    };
    step();
  });
}

/** In the page: notes every picture that is shown, and keeps the pixels of the last moving one. */
function watch() {
  const canvas = document.querySelector("canvas.picture");
  const pixels = () => canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  window.snellSeen = { shown: [], moving: null, keeps: false, pixels };
  const seen = window.snellSeen;
  const note = () => {
    const { frame, kind, samples } = canvas.dataset;
    const status = document.querySelector(".status").textContent;
    const noise = Number(status.match(/noise ([\d.]+)/)?.[1] ?? Number.NaN);
    const { denoised } = canvas.dataset;
    seen.shown.push({
      at: performance.now(),
      frame,
      kind,
      samples: Number(samples),
      noise,
      denoised,
    });
    if (kind === "jpeg" && seen.keeps) seen.moving = pixels();
  };
  // The numbers are written after the picture.
  new MutationObserver(() => setTimeout(note)).observe(canvas, {
    attributes: true,
    attributeFilter: ["data-frame"],
  });
}

/** In the page: mean differences of the last moving picture to the one that is shown now. */
function differences() {
  const canvas = document.querySelector("canvas.picture");
  const { moving, pixels } = window.snellSeen;
  const rest = pixels();
  if (!moving || moving.length !== rest.length) return { mean: Number.NaN, blocks: Number.NaN };
  const across = Math.ceil(canvas.width / 16);
  const blocks = new Map();
  let sum = 0;
  for (let i = 0, count = 0; i < rest.length; i++) {
    if (i % 4 === 3) continue;
    const pixel = i >> 2;
    const [x, y] = [pixel % canvas.width, Math.floor(pixel / canvas.width)];
    const difference = moving[i] - rest[i];
    sum += (Math.abs(difference) - sum) / ++count;
    const key = ((y >> 4) * across + (x >> 4)) * 3 + (i % 4);
    const block = blocks.get(key) ?? [0, 0];
    blocks.set(key, [block[0] + difference, block[1] + 1]);
  }
  const means = [...blocks.values()].map(([total, count]) => Math.abs(total / count));
  return { mean: sum, blocks: means.reduce((a, b) => a + b, 0) / means.length };
}

async function shoot(page, scene, what) {
  if (!env.SHOTS) return;
  mkdirSync(env.SHOTS, { recursive: true });
  const url = await page.evaluate(() =>
    document.querySelector("canvas.picture").toDataURL("image/png"),
  );
  const name = `${basename(scene).replace(/\W+/g, "-")}-${what}.png`;
  writeFileSync(join(env.SHOTS, name), Buffer.from(url.split(",")[1], "base64"));
}

async function measure(browser, scene) {
  const page = await browser.newPage({ viewport: { width: WIDTH, height: HEIGHT + 80 } });
  // The bar and the status line take some; the picture gets its whole size by this.
  await page.addInitScript(
    (style) =>
      addEventListener("DOMContentLoaded", () =>
        document.head.append(
          Object.assign(document.createElement("style"), { textContent: style }),
        ),
      ),
    `.panel{display:none!important}
     .stage{flex:none!important;width:${WIDTH}px!important;height:${HEIGHT}px!important}`,
  );
  const start = performance.now();
  const server = await serve(scene);
  const line = env.RATE ? await slowLine(server.url, Number(env.RATE)) : null;
  await page.goto(line?.url ?? server.url);
  await page.waitForSelector("canvas[data-frame]", { timeout: 120_000 });
  const first = performance.now() - start;
  await page.waitForTimeout(REST * 1000);
  await page.evaluate(watch);
  const box = await page.locator(".stage").boundingBox();
  await page.mouse.move(box.x + WIDTH / 2, box.y + HEIGHT / 2);
  await page.mouse.down();
  await page.evaluate(() => {
    window.snellFrames = [];
  });
  const before = server.spent();
  await page.evaluate(turn, SECONDS - 1);
  const spent = server.spent() - before;
  await shoot(page, scene, "moving");
  const frames = await page.evaluate(() => window.snellFrames);
  await page.evaluate(() => (window.snellSeen.keeps = true));
  const stopped = await page.evaluate(turn, 1);
  const since = (frame) => frame && frame.at - stopped;
  const shown = async (test) => {
    const all = await page.evaluate(() => window.snellSeen.shown);
    return since(all.find((frame) => frame.at > stopped && frame.kind === "half" && test(frame)));
  };
  await page
    .waitForFunction(
      (stopped) =>
        window.snellSeen.shown.some((frame) => frame.at > stopped && frame.kind !== "jpeg") &&
        document.querySelector(".dot.done") !== null,
      stopped,
      { timeout: FINISH * 1000 },
    )
    .catch(() => {});
  await page.mouse.up();
  const { mean, blocks } = await page.evaluate(differences);
  await shoot(page, scene, "rest");
  const rest = await shown(() => true);
  const quiet = await shown((frame) => frame.denoised === "true" || frame.noise < 2);
  const samples = await page.evaluate(
    () => document.querySelector("canvas.picture").dataset.samples,
  );
  await page.close();
  await server.stop();
  line?.close();
  // The first second is for the controller to find its scale.
  const steady = frames.slice(Math.ceil(frames.length / (SECONDS - 1)));
  const of = (name) => steady.map((frame) => frame[name]).filter((value) => value >= 0);
  const ms = (value) => `${value?.toFixed(0) ?? "never"} ms`;
  console.log(
    `${basename(scene)}: first ${ms(first)}; ` +
      `width ${(quantile(of("scale"), 0.5) * WIDTH).toFixed(0)}, ` +
      `${(frames.length / (SECONDS - 1)).toFixed(1)} frames/s, ` +
      `latency ${ms(quantile(of("latency"), 0.5))} (95 %: ${ms(quantile(of("latency"), 0.95))}), ` +
      `made in ${ms(quantile(of("milliseconds"), 0.5))} ` +
      `(95 %: ${ms(quantile(of("milliseconds"), 0.95))}), cpu ${ms(spent / frames.length)}; ` +
      `light ${mean.toFixed(1)} levels (blocks ${blocks.toFixed(1)}) to ${samples} samples; ` +
      `quiet ${ms(quiet)}, rest ${ms(rest)}; load ${loadavg()[0].toFixed(1)}`,
  );
}

const browser = await chromium.launch({
  executablePath: env.CHROME ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu"],
});
for (const scene of process.argv.slice(2)) await measure(browser, scene);
await browser.close();
