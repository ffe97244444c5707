// What browser tests share: a real browser, and the real server. SNELL and CHROME name the
// programs, and PAGE the folder of a built page to test in place of the server's own.

import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before } from "node:test";
import { chromium } from "playwright-core";

export const SNELL = process.env.SNELL ?? "snell";
const CHROME = process.env.CHROME;
const VIEWPORT = { width: 860, height: 420 };
/** Slow machines under load need long. */
export const PATIENCE = 120_000;

let browser;
export const folder = mkdtempSync(join(tmpdir(), "snell-view-"));

before(async () => {
  assert.ok(CHROME, "CHROME names a Chromium or Chrome");
  browser = await chromium.launch({
    executablePath: CHROME,
    args: ["--no-sandbox", "--disable-gpu"],
  });
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

/** Starts `snell view`; gives its address and a way to stop it. */
export async function serve(...words) {
  const child = spawn(SNELL, ["view", "--no-open", ...words], {
    stdio: ["ignore", "pipe", "pipe"],
  });
  const wait = new Promise((resolve, reject) => {
    let text = "";
    child.stdout.on("data", (data) => {
      text += data;
      if (text.includes("\n")) resolve(text.trim());
    });
    child.stderr.on("data", (data) => (text += data));
    child.on("exit", (code) => reject(new Error(`snell view ended with ${code}: ${text}`)));
  });
  const url = await wait;
  const stop = () =>
    new Promise((resolve) => {
      child.removeAllListeners("exit");
      child.on("exit", resolve);
      child.kill("SIGINT");
    });
  return { url, stop };
}

export async function open(url, prepare = () => {}, viewport = VIEWPORT) {
  const page = await browser.newPage({ viewport });
  page.setDefaultTimeout(PATIENCE);
  await page.addInitScript(prepare);
  const faults = [];
  page.on("pageerror", (error) => faults.push(error.message));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  // A page that was just built, without a build of the server.
  for (const file of process.env.PAGE ? ["app.js", "app.css"] : []) {
    await page.route(`**/${file}`, (route) =>
      route.fulfill({ path: join(process.env.PAGE, file) }),
    );
  }
  await page.goto(url);
  await page.waitForSelector("canvas[data-frame]");
  return { page, faults };
}

/**
 * Does something on the page of a scene once its picture rests. Nothing may be said in the console
 * but that the server has refused something (422), which the page says too.
 */
export async function onPage(words, act, { viewport = VIEWPORT, prepare } = {}) {
  const server = await serve(...words);
  try {
    const { page, faults } = await open(server.url, prepare, viewport);
    await isDone(page);
    await act(page, server);
    assert.deepEqual(
      faults.filter((fault) => !fault.includes("status of 422")),
      [],
    );
    await page.close();
  } finally {
    await server.stop();
  }
}

/** A section of the panel. */
export const section = (page, title) =>
  page.locator(".panel > details").filter({
    has: page.locator("summary", { hasText: new RegExp(`^${title}`) }),
  });

/** Opens a section of the panel. */
export async function unfold(page, title) {
  const found = section(page, title).first();
  if (!(await found.evaluate((details) => details.open)))
    await found.locator("summary").first().click();
  return found;
}

/** Chooses an entry of a menu of the bar. */
export async function choose(page, menu, item) {
  await page.locator(".menu summary", { hasText: menu }).click();
  await page.locator(".menu[open] button", { hasText: item }).click();
}

/** The middle of the picture. */
export async function middle(page) {
  const box = await page.locator(".stage").boundingBox();
  return [box.x + box.width / 2, box.y + box.height / 2];
}

/** Drops files on an element: pairs of a name and its content, text or bytes. */
export const drop = (page, files, selector = "main") =>
  page.evaluate(
    ([target, list]) => {
      const data = new DataTransfer();
      for (const [name, bytes] of list) data.items.add(new File([new Uint8Array(bytes)], name));
      const event = { dataTransfer: data, bubbles: true, cancelable: true };
      document.querySelector(target).dispatchEvent(new DragEvent("drop", event));
    },
    [selector, files.map(([name, content]) => [name, [...Buffer.from(content)]])],
  );

/** The page shows the picture at rest in the size of its stage; the server begins with another. */
export const isDone = (page) =>
  page.waitForFunction(() => {
    const canvas = document.querySelector("canvas.picture");
    const { clientWidth, clientHeight } = document.querySelector(".stage");
    const isWhole = canvas.width === clientWidth && canvas.height === clientHeight;
    return (
      isWhole && canvas.dataset.kind === "half" && document.querySelector(".dot.done") !== null
    );
  });

/** A number that differs for different pictures. */
export const fingerprint = (page) =>
  page.evaluate(() => {
    const canvas = document.querySelector("canvas.picture");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let hash = 0;
    for (const value of data) hash = (hash * 31 + value) | 0;
    return hash;
  });

/**
 * The number of the picture once it is the expected one, or that of the last when patience is over.
 * (A dot that is green may still be that of the picture before.)
 */
export async function settled(page, expected) {
  for (const end = Date.now() + 10000; ; await page.waitForTimeout(50)) {
    const found = await fingerprint(page);
    if (found === expected || Date.now() > end) return found;
  }
}

export async function drag(page, dx, dy) {
  const box = await page.locator(".stage").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= 8; i++) await page.mouse.move(x + (dx * i) / 8, y + (dy * i) / 8);
  await page.mouse.up();
}

/** The words of a command as a shell reads them. */
const words = (command) =>
  [...command.matchAll(/'((?:[^']|'\\'')*)'|(\S+)/g)].map(
    (m) => m[2] ?? m[1].replaceAll("'\\''", "'"),
  );

/** The command that the page copies. */
export async function copiedCommand(page) {
  await page.evaluate(() =>
    Object.defineProperty(navigator, "clipboard", {
      configurable: true,
      value: {
        writeText: async () => {
          throw 0;
        },
      },
    }),
  );
  // A message from before must not be taken for the command.
  await page.evaluate(() => {
    for (const button of document.querySelectorAll(".notices button")) button.click();
  });
  await page.getByText("Save", { exact: true }).click();
  await page.getByText("Copy the command").click();
  const command = words(
    (await page.locator(".notices p", { hasText: "snell render" }).first().textContent())
      .replace(/\n?×$/, "")
      .trim(),
  );
  assert.deepEqual(command.slice(0, 2), ["snell", "render"]);
  return command;
}

/** The command makes the picture that the page shows, to the bit. */
export async function isRenderedBy(command, page, options = {}) {
  const [shown, rendered] = [join(folder, "shown.pfm"), join(folder, "rendered.pfm")];
  const encoded = await page.evaluate(async () => {
    const picture = await (await fetch("save?format=pfm")).blob();
    return new Promise((resolve) => {
      const reader = new FileReader();
      reader.onload = () => resolve(reader.result.split(",")[1]);
      reader.readAsDataURL(picture);
    });
  });
  writeFileSync(shown, Buffer.from(encoded, "base64"));
  execFileSync(SNELL, [...command.slice(1), "-o", rendered, "-q"], options);
  assert.ok(
    readFileSync(shown).equals(readFileSync(rendered)),
    "the picture at rest is the one of snell render",
  );
}
