// What the page says and saves is true.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { closeSync, ftruncateSync, openSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import {
  copiedCommand,
  drag,
  fingerprint,
  folder,
  isDone,
  open,
  PATIENCE,
  SNELL,
  serve,
} from "./browser.mjs";

const CORNELL = ["cornell-box", "--", "--spp", "2"];

/** The file that the menu saves. */
async function saved(page, name) {
  const download = page.waitForEvent("download");
  await page.getByText("Save", { exact: true }).click();
  await page.getByText(name).click();
  return readFileSync(await (await download).path());
}

/** Sets the exposure in the panel. */
async function expose(page, stops) {
  await page.getByLabel("Exposure (stops)").last().fill(String(stops));
  await page.keyboard.press("Tab");
}

test("what is saved is the file of the copied command, byte by byte", {
  timeout: PATIENCE * 3,
}, async () => {
  const server = await serve(...CORNELL);
  try {
    const { page, faults } = await open(server.url);
    await isDone(page);
    await drag(page, 40, 10);
    await expose(page, -1.5);
    await page.getByLabel("Tone map").selectOption("aces");
    await page.waitForTimeout(300);
    await isDone(page);
    for (const [entry, extension] of [
      ["PNG, as shown", "png"],
      ["OpenEXR, linear", "exr"],
    ]) {
      const shown = await saved(page, entry);
      const command = await copiedCommand(page);
      assert.ok(command.includes("--exposure=-1.5") && command.includes("aces"), command.join(" "));
      const path = join(folder, `rendered.${extension}`);
      execFileSync(SNELL, [...command.slice(1), "-o", path, "-q"]);
      assert.ok(shown.equals(readFileSync(path)), `${extension}: the same bytes`);
      // The receipt in it is that of the command.
      writeFileSync(join(folder, `shown.${extension}`), shown);
      execFileSync(SNELL, ["verify", join(folder, `shown.${extension}`)]);
    }
    // A layer is shown and saved as it is written.
    await page.locator("label", { hasText: /^Show/ }).locator("select").selectOption("normal");
    await page.waitForTimeout(300);
    await isDone(page);
    const shown = await saved(page, "PNG, as shown");
    const path = join(folder, "normal.png");
    execFileSync(SNELL, [...(await copiedCommand(page)).slice(1), "-o", path, "-q"]);
    assert.ok(shown.equals(readFileSync(path)), "the normals");
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("a picture that is saved while it moves is the next one at rest", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve(...CORNELL);
  try {
    const { page } = await open(server.url);
    await isDone(page);
    const before = await saved(page, "PNG, as shown");
    await page.getByText("Save", { exact: true }).click();
    const download = page.waitForEvent("download");
    await page.evaluate(() => {
      const stage = document.querySelector(".stage");
      stage.setPointerCapture = () => {};
      const at = (type, x) =>
        stage.dispatchEvent(
          new PointerEvent(type, { clientX: x, clientY: 200, pointerId: 9, bubbles: true }),
        );
      at("pointerdown", 200);
      at("pointermove", 260);
      at("pointerup", 260);
      // In the same moment, before any picture of it.
      [...document.querySelectorAll("button")]
        .find((b) => b.textContent === "PNG, as shown")
        .click();
    });
    const moved = readFileSync(await (await download).path());
    assert.ok(!moved.equals(before), "not the picture before the move");
    await isDone(page);
    const after = await saved(page, "PNG, as shown");
    assert.ok(pixels(moved).equals(pixels(after)) || moved.length !== before.length);
    await page.close();
  } finally {
    await server.stop();
  }
});

/** The compressed pixels of a PNG, without its metadata. */
function pixels(png) {
  const parts = [];
  for (let at = 8; at < png.length; ) {
    const length = png.readUInt32BE(at);
    if (png.toString("latin1", at + 4, at + 8) === "IDAT")
      parts.push(png.subarray(at + 8, at + 8 + length));
    at += 12 + length;
  }
  return Buffer.concat(parts);
}

test("who does not steer changes nothing, and taking over takes the size along", {
  timeout: PATIENCE * 2,
}, async () => {
  const server = await serve(...CORNELL);
  try {
    const { page: first } = await open(server.url);
    await isDone(first);
    const shown = await fingerprint(first);
    const { page: second } = await open(server.url, () => {}, { width: 500, height: 640 });
    await second.getByRole("button", { name: "Take over" }).waitFor();
    await drag(second, 60, 0);
    await second.getByText("take over to change something").waitFor();
    await second.keyboard.press("0");
    await second.keyboard.press("Control+z");
    assert.equal(
      await second.locator(".settings[inert]").count(),
      await second.locator(".settings").count(),
    );
    assert.ok(await second.locator(".bar button", { hasText: "Read again" }).isDisabled());
    const refused = await second.evaluate(async () => {
      const response = await fetch("open?builtin=spheres&client=99", { method: "POST" });
      return response.status;
    });
    assert.equal(refused, 409);
    await first.waitForTimeout(500);
    assert.equal(await fingerprint(first), shown, "the other page is as it was");
    assert.match(await first.title(), /^cornell-box/);
    await second.getByRole("button", { name: "Take over" }).click();
    await isDone(second);
    const size = await second.evaluate(() => {
      const { width, height } = document.querySelector("canvas.picture");
      return [width, height];
    });
    assert.ok(size[0] === 500 && size[1] > 400, `${size}`);
    await second.close();
    await first.close();
  } finally {
    await server.stop();
  }
});

test("Read again reads what is shown", { timeout: PATIENCE * 2 }, async () => {
  const path = join(folder, "ground.off");
  const triangle = (x) => `OFF\n3 1 0\n0 0 0\n${x} 0 0\n0 1 0\n3 0 1 2\n`;
  writeFileSync(path, triangle(1));
  const server = await serve(path, "--", "--spp", "1");
  try {
    const { page } = await open(server.url);
    await isDone(page);
    const before = await fingerprint(page);
    const again = async () => {
      await page.locator(".menu summary").first().click();
      await page.getByRole("button", { name: "Read again" }).click();
    };
    writeFileSync(path, triangle(3));
    await again();
    await page.waitForFunction(() => document.querySelector(".dot.done"));
    for (let i = 0; i < 50 && (await fingerprint(page)) === before; i++)
      await page.waitForTimeout(100);
    assert.notEqual(await fingerprint(page), before, "the file has changed");
    await page.locator(".menu summary").first().click();
    await page.getByRole("button", { name: "spheres", exact: true }).click();
    await page.waitForFunction(() => document.title.startsWith("spheres"));
    await again();
    await page.waitForTimeout(1000);
    assert.match(await page.title(), /^spheres/, "not the scene of the command line");
    // A file that was dropped is not there to be read again.
    await page.setInputFiles("input[type=file] >> nth=0", {
      name: "dropped.off",
      mimeType: "",
      buffer: Buffer.from(triangle(2)),
    });
    await page.waitForFunction(() => document.title.startsWith("dropped"));
    await again();
    await page.getByText("drop it again").waitFor();
    assert.match(await page.title(), /^dropped/);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("a file over the limit is refused before it is read", { timeout: PATIENCE }, async () => {
  const path = join(folder, "huge.ply");
  const file = openSync(path, "w");
  ftruncateSync(file, 257 * 2 ** 20);
  closeSync(file);
  const server = await serve(...CORNELL);
  try {
    const { page, faults } = await open(server.url);
    const asked = [];
    page.on("request", (request) => asked.push(request.url()));
    await page.setInputFiles("input[type=file] >> nth=0", path);
    await page.getByText("too much to send").waitFor();
    assert.ok(!asked.some((url) => url.includes("open?")), "nothing was sent");
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});

test("a server that is gone is said, and nothing pretends to work", {
  timeout: PATIENCE,
}, async () => {
  const server = await serve(...CORNELL);
  const { page } = await open(server.url);
  await isDone(page);
  await server.stop();
  await page.getByText("No connection to the server").waitFor();
  await page.getByText("It may have ended").waitFor();
  assert.equal(await page.locator(".dot.lost").count(), 1);
  await page.getByText("Save", { exact: true }).click();
  await page.getByText("PNG, as shown").click();
  await page.getByText("The server does not answer").waitFor();
  await page.close();
});

test("the gallery has its pictures at once, with names", { timeout: PATIENCE }, async () => {
  const server = await serve();
  try {
    const { page, faults } = await open(server.url);
    const cards = page.locator(".gallery .card");
    await cards.first().waitFor();
    const started = Date.now();
    await page.waitForFunction(() => {
      const pictures = [...document.querySelectorAll(".card img")];
      for (const picture of pictures) picture.loading = "eager";
      return pictures.length > 0 && pictures.every((picture) => picture.naturalWidth === 288);
    });
    assert.ok(Date.now() - started < 10_000);
    const names = await cards.locator("strong").allInnerTexts();
    assert.ok(names.includes("teapot") && names.every((name) => name.length > 2));
    assert.deepEqual(faults, []);
    await page.close();
  } finally {
    await server.stop();
  }
});
