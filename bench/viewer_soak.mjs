// A robot that uses the viewer for ten minutes (MINUTES): turns, edits, takes back, explains,
// reloads pages and drops connections. Says how memory and threads of the server go; they must stay
// flat.
//
//   SNELL=target/release/snell CHROME=chromium node bench/viewer_soak.mjs [scene]

import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const { chromium } = createRequire(new URL("../web/package.json", import.meta.url))(
  "playwright-core",
);
const MINUTES = Number(process.env.MINUTES ?? 10);
const scene = process.argv[2] ?? "cornell-box";
let seed = 1;
const random = () => {
  seed = (seed * 1103515245 + 12345) % 2147483648;
  return seed / 2147483648;
};

const child = spawn(
  process.env.SNELL ?? "snell",
  ["view", scene, "--no-open", "--", "--spp", "64"],
  { stdio: ["ignore", "pipe", "inherit"] },
);
const url = await new Promise((resolve) =>
  child.stdout.once("data", (data) => resolve(String(data).trim())),
);
const browser = await chromium.launch({
  executablePath: process.env.CHROME ?? "/usr/bin/chromium",
  args: ["--no-sandbox"],
});
const faults = [];
const open = async () => {
  const page = await browser.newPage({ viewport: { width: 900, height: 600 } });
  page.on("pageerror", (error) => faults.push(error.message));
  await page.goto(url);
  await page.waitForSelector("canvas[data-frame]", { timeout: 60_000 });
  return page;
};
process.on("exit", () => child.kill("SIGINT"));
const facts = () => {
  const status = readFileSync(`/proc/${child.pid}/status`, "utf8");
  const number = (name) => Number(status.match(new RegExp(`${name}:\\s+(\\d+)`))[1]);
  return { megabytes: Math.round(number("VmRSS") / 1024), threads: number("Threads") };
};
/** A connection that is cut, or talks nonsense. */
const rude = (page) =>
  page.evaluate(
    async (kind) => {
      const socket = new WebSocket(new URL("ws", document.baseURI).href.replace("http", "ws"));
      await new Promise((resolve) => (socket.onopen = resolve));
      if (kind === 1) socket.send("x".repeat(3 << 20));
      if (kind === 2) socket.send('{"type":"camera"}');
      setTimeout(() => socket.close(), 50);
    },
    Math.floor(random() * 3),
  );

let page = await open();
const begin = Date.now();
let [done, told] = [0, -1];
while (Date.now() - begin < MINUTES * 60_000) {
  const box = await page.locator(".stage").boundingBox();
  const at = () => [
    box.x + box.width * (0.2 + 0.6 * random()),
    box.y + box.height * (0.2 + 0.6 * random()),
  ];
  const steps = [
    async () => {
      await page.mouse.move(...at());
      await page.mouse.down();
      for (let i = 0; i < 12; i++) await page.mouse.move(...at());
      await page.mouse.up();
    },
    async () => page.mouse.click(...at()),
    async () => page.mouse.wheel(0, 200 * (random() - 0.5)),
    async () => {
      const field = page.getByLabel("reflectance red", { exact: true });
      if (
        await field
          .first()
          .isVisible()
          .catch(() => false)
      ) {
        await field.first().fill(random().toFixed(2));
        await page.keyboard.press("Tab");
      }
    },
    async () => page.locator(".stage").press(random() < 0.7 ? "Control+z" : "Control+Shift+z"),
    async () => {
      await page.mouse.move(...at());
      await page.keyboard.press("x");
      await page
        .locator(".explain")
        .waitFor({ timeout: 20_000 })
        .catch(() => {});
      if (await page.locator(".explain").count())
        await page.getByRole("button", { name: "Close" }).click();
    },
    async () => page.evaluate(async () => void (await fetch("save?format=exr")).arrayBuffer()),
    async () => rude(page),
    async () => {
      await page.close();
      page = await open();
    },
    async () => page.locator(".stage").press("f"),
    async () => page.waitForTimeout(1500),
  ];
  // What the robot cannot do just now, such as clicking on a page that is closing, is no fault of
  // the server.
  await steps[Math.floor(random() * steps.length)]().catch(
    (error) => error.name === "TimeoutError" || Promise.reject(error),
  );
  done += 1;
  const minute = Math.floor((Date.now() - begin) / 60_000);
  if (minute !== told) {
    told = minute;
    console.log(
      `minute ${minute}: ${JSON.stringify(facts())}, ${done} actions, ${faults.length} faults`,
    );
  }
}
console.log(`end: ${JSON.stringify(facts())}, ${done} actions, faults: ${JSON.stringify(faults)}`);
await browser.close();
await new Promise((resolve) => setTimeout(resolve, 3000));
console.log(`without pages: ${JSON.stringify(facts())}`);
child.on("exit", (code) => process.exit(faults.length > 0 || code !== 0 ? 1 : 0));
child.kill("SIGINT");
