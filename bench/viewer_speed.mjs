// How fast the viewer is, as a browser sees it: frames a second and latency while the camera turns,
// by scene.
//
//   SNELL=target/release/snell CHROME=chromium node bench/viewer_speed.mjs scene.glb night-town ...
//
// Each scene is opened at 1280x720 pixels and turned by the mouse for ten seconds. Latency is from
// the input to the frame that shows it. The first line of each scene is from the command to the
// first picture on the page's canvas, browser already running. THREADS=2 limits the renderer's
// threads.

import { spawn } from "node:child_process";
import { createRequire } from "node:module";
import { loadavg } from "node:os";

const { chromium } = createRequire(new URL("../web/package.json", import.meta.url))(
  "playwright-core",
);
const SNELL = process.env.SNELL ?? "snell";
const SECONDS = Number(process.env.SECONDS ?? 10);
const threads = process.env.THREADS ? ["--threads", process.env.THREADS] : [];

const quantile = (sorted, q) => sorted[Math.min(sorted.length - 1, Math.floor(sorted.length * q))];

async function measure(browser, scene) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  // The bar and the status line take some; the picture gets 1280x720 by this.
  await page.addInitScript(() => {
    const style =
      ".panel{display:none!important}" +
      ".stage{flex:none!important;width:1280px!important;height:720px!important}";
    addEventListener("DOMContentLoaded", () =>
      document.head.append(Object.assign(document.createElement("style"), { textContent: style })),
    );
  });
  const start = performance.now();
  const child = spawn(SNELL, ["view", scene, "--no-open", ...threads], {
    stdio: ["ignore", "pipe", "inherit"],
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
  const served = performance.now() - start;
  await page.goto(url);
  await page.waitForSelector("canvas[data-frame]", { timeout: 120_000 });
  const first = performance.now() - start;
  await page.waitForTimeout(1000);
  const box = await page.locator(".stage").boundingBox();
  await page.mouse.move(box.x + 640, box.y + 360);
  await page.mouse.down();
  // The hand is in the page, at the browser's own rate: messages of the robot would come too
  // slowly.
  await page.evaluate(() => {
    window.snellFrames = [];
    const stage = document.querySelector(".stage");
    const { left, top } = stage.getBoundingClientRect();
    const step = (i) => {
      const [clientX, clientY] = [
        left + 640 + 200 * Math.sin(i / 40),
        top + 360 + 30 * Math.sin(i / 25),
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
      requestAnimationFrame(() => step(i + 1));
    };
    step(0);
  });
  const begin = performance.now();
  const [latencies, scales, spent] = [[], [], []];
  await page.waitForTimeout(SECONDS * 1000);
  const frames = await page.evaluate(() => window.snellFrames);
  const elapsed = (performance.now() - begin) / 1000;
  await page.mouse.up();
  // The first second is for the controller to find its scale.
  for (const frame of frames.slice(Math.ceil(frames.length / SECONDS))) {
    if (frame.latency >= 0) latencies.push(frame.latency);
    scales.push(frame.scale);
    spent.push(frame.milliseconds);
  }
  latencies.sort((a, b) => a - b);
  scales.sort((a, b) => a - b);
  spent.sort((a, b) => a - b);
  await page.close();
  await new Promise((resolve) => {
    child.on("exit", resolve);
    child.kill("SIGINT");
  });
  const fps = frames.length / elapsed;
  console.log(
    `${scene}: served ${served.toFixed(0)} ms, first picture ${first.toFixed(0)} ms; ` +
      `${fps.toFixed(1)} frames/s, latency median ${quantile(latencies, 0.5)?.toFixed(0)} ms, ` +
      `95 % ${quantile(latencies, 0.95)?.toFixed(0)} ms, ` +
      `scale ${quantile(scales, 0.5)?.toFixed(2)}, rendering median ` +
      `${quantile(spent, 0.5)?.toFixed(0)} ms, 95 % ${quantile(spent, 0.95)?.toFixed(0)} ms, ` +
      `load ${loadavg()[0].toFixed(1)}`,
  );
}

const browser = await chromium.launch({
  executablePath: process.env.CHROME ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});
for (const scene of process.argv.slice(2)) await measure(browser, scene);
await browser.close();
