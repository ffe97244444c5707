// Ten tasks in the viewer, as a hand does them: how many clicks, keys, drags and drops each takes,
// and the seconds until the page shows it.
//
//   SNELL=target/release/snell CHROME=chromium node bench/viewer_tasks.mjs a.glb light.hdr a.png
//
// The scene should have a texture and move. SHOTS=folder keeps a screenshot after each task. Hands
// are slower than this program: `seconds` is what the page makes them wait.

import { spawn } from "node:child_process";
import { mkdirSync, readFileSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, join } from "node:path";

const { chromium } = createRequire(new URL("../web/package.json", import.meta.url))(
  "playwright-core",
);
const env = process.env;
const [scene, light, image] = process.argv.slice(2);
const child = spawn(env.SNELL ?? "snell", ["view", "cornell-box", "--no-open"], {
  stdio: ["ignore", "pipe", "ignore"],
});
const url = await new Promise((resolve) => {
  let text = "";
  child.stdout.on("data", (data) => {
    text += data;
    if (text.includes("\n")) resolve(text.trim());
  });
});
const browser = await chromium.launch({
  executablePath: env.CHROME ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu"],
});
const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
await page.goto(url);
await page.waitForSelector("canvas[data-frame]");
await page.waitForTimeout(3000);

let acts = [];
const act = async (name, done) => {
  acts.push(name);
  await done;
};
const click = (locator) => act("click", locator.click());
const press = (key) => act("key", page.keyboard.press(key));
const button = (name) => page.getByRole("button", { name, exact: true }).first();
const frame = () => page.evaluate(() => document.querySelector("canvas.picture").dataset.frame);
/** Waits for the first picture after a change, which is a moving one. */
const changed = (old) =>
  page.waitForFunction((before) => {
    const { frame, kind } = document.querySelector("canvas.picture").dataset;
    return frame !== before && kind === "jpeg";
  }, old);
const drop = (selector, path) =>
  act(
    "drop",
    page.evaluate(
      ([target, name, bytes]) => {
        const data = new DataTransfer();
        const content = Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0));
        data.items.add(new File([content], name));
        const event = { dataTransfer: data, bubbles: true, cancelable: true };
        document.querySelector(target).dispatchEvent(new DragEvent("drop", event));
      },
      [selector, basename(path), readFileSync(path).toString("base64")],
    ),
  );
const stage = async (x, y) => {
  const box = await page.locator(".stage").boundingBox();
  return [box.x + box.width * x, box.y + box.height * y];
};
const clickAt = async (x, y) => act("click", page.mouse.click(...(await stage(x, y))));

async function task(name, work) {
  acts = [];
  const old = await frame();
  const start = performance.now();
  await work(old);
  const seconds = (performance.now() - start) / 1000;
  const counts = [...new Set(acts)].map((kind) => {
    const count = acts.filter((other) => other === kind).length;
    return `${count} ${kind}${count > 1 ? "s" : ""}`;
  });
  console.log(`${name}: ${counts.join(", ")}; ${seconds.toFixed(2)} s`);
  await page.waitForTimeout(2500);
  if (!env.SHOTS) return;
  mkdirSync(env.SHOTS, { recursive: true });
  await page.screenshot({ path: join(env.SHOTS, `${name.replaceAll(" ", "-")}.png`) });
}

const stem = basename(scene).replace(/\.\w+$/, "");
await task("open a file", async (old) => {
  await drop("main", scene);
  await page.waitForFunction((name) => document.title.startsWith(name), stem);
  await changed(old);
});
await task("frame it", async (old) => {
  await press("f");
  await changed(old);
});
await task("turn it", async (old) => {
  const [x, y] = await stage(0.5, 0.5);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 120, y + 10, { steps: 8 });
  await act("drag", page.mouse.up());
  await changed(old);
});
const material = () =>
  page
    .locator(".panel > details")
    .filter({ has: page.locator("summary", { hasText: /^Material/ }) })
    .first();
await task("change a colour", async (old) => {
  await clickAt(0.5, 0.5);
  const color = material().locator("input[type=color]").first();
  await color.waitFor();
  // The browser's own window for colours: a click opens it, and one chooses.
  acts.push("click", "click");
  await color.fill("#2266cc");
  await changed(old);
});
await task("swap a texture", async (old) => {
  const slot = material().locator("fieldset.slot").first();
  if ((await slot.count()) === 0)
    await click(
      material()
        .getByLabel(/^texture of/)
        .first(),
    );
  await slot.waitFor();
  const name = await slot.getAttribute("aria-label");
  await drop(`fieldset.slot[aria-label="${name}"]`, image);
  await changed(old);
});
await task("light it by a picture", async (old) => {
  await drop("main", light);
  await changed(old);
});
await task("measure a distance", async () => {
  await press("m");
  await page.getByText("(0 of 2)").waitFor();
  await clickAt(0.48, 0.5);
  await page.getByText("(1 of 2)").waitFor();
  await clickAt(0.54, 0.5);
  await page.getByText("(0 of 2)").waitFor();
  await page.locator(".overlay text").first().waitFor();
});
await press("Escape");
await task("play its motion", async (old) => {
  await click(button("Play"));
  await changed(old);
});
await button("Pause").click();
await page.waitForTimeout(3000);
await task("compare two pictures", async () => {
  await press("c");
  await page.getByLabel("reference on the left, picture on the right").waitFor();
});
await press("c");
await task("save a picture", async () => {
  const download = page.waitForEvent("download", { timeout: 120_000 });
  await click(page.getByText("Save", { exact: true }));
  await click(page.getByText("PNG, as shown"));
  const path = await (await download).path();
  if (statSync(path).size === 0) throw new Error("nothing was saved");
});
await browser.close();
child.kill("SIGINT");
