// The page on a phone, and by keyboard and screen reader.

import assert from "node:assert/strict";
import { test } from "node:test";
import { isDone, onPage, open, PATIENCE, serve } from "./browser.mjs";

const PHONE = { width: 390, height: 844 };
const within = (words, act, viewport = PHONE) => onPage(words, act, { viewport });

/** Side of a target for fingers, in pixels. */
const TARGET = 40;

const CORNELL = ["cornell-box", "--", "--spp", "1"];

/** The visible controls that are too small for a finger, or reach out of the window. */
const misfits = (page) =>
  page.evaluate((least) => {
    const bad = [];
    for (const element of document.querySelectorAll("button, select, summary, input")) {
      const box = element.getBoundingClientRect();
      // What is in a closed menu has a place in Chromium, but is not seen.
      const others = ".path-tree, .samples, details:not([open]) > :not(summary)";
      if (box.width === 0 || box.height === 0 || element.closest(others)) continue;
      const name = element.getAttribute("aria-label") ?? element.textContent;
      // The whole line of a tick is its target.
      const target = /checkbox|radio/.test(element.type) ? element.closest("label") : element;
      const { width, height } = (target ?? element).getBoundingClientRect();
      if (width < least - 0.5 || height < least - 0.5) bad.push(`${name}: ${width} x ${height}`);
      if (box.left < -0.5 || box.right > window.innerWidth + 0.5)
        bad.push(`${name}: ${box.left} to ${box.right}`);
    }
    return bad;
  }, TARGET);

/** The controls without a name in Chromium's accessibility tree. */
async function nameless(page) {
  const session = await page.context().newCDPSession(page);
  const { nodes } = await session.send("Accessibility.getFullAXTree");
  await session.detach();
  const controls = new Set(
    (
      "button checkbox combobox slider spinbutton textbox searchbox radio link menuitem dialog " +
      "img image DisclosureTriangle application toolbar complementary progressbar " +
      "ProgressIndicator ColorWell"
    ).split(" "),
  );
  return nodes
    .filter((node) => !node.ignored && controls.has(node.role?.value ?? ""))
    .filter((node) => !(node.name?.value ?? "").trim())
    .map((node) => `${node.role.value} ${JSON.stringify(node.properties ?? [])}`);
}

test(
  "everything is in reach of a finger in a window of 390 pixels",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    within(CORNELL, async (page) => {
      await isDone(page);
      const stage = await page.locator(".stage").boundingBox();
      assert.ok(stage.height > 0.85 * PHONE.height, "the picture has the window");
      assert.deepEqual(await misfits(page), []);
      for (const menu of await page.locator(".menu summary").all()) {
        await menu.click();
        assert.deepEqual(await misfits(page), []);
        await page.keyboard.press("Escape");
      }
      assert.equal(await page.locator(".menu[open]").count(), 0);
      await page.getByRole("button", { name: "Panel" }).click();
      const sheet = await page.locator(".side").boundingBox();
      assert.ok(sheet.y > 0.35 * PHONE.height && sheet.width === PHONE.width, "a sheet below");
      assert.ok((await page.locator(".stage").boundingBox()).height === stage.height);
      await page.evaluate(() => {
        for (const details of document.querySelectorAll(".panel details")) details.open = true;
      });
      assert.deepEqual(await misfits(page), []);
    }),
);

test(
  "Escape and presses elsewhere close menus, sheets and dialogs",
  {
    timeout: PATIENCE * 2,
  },
  () =>
    within(CORNELL, async (page) => {
      await isDone(page);
      const shows = async (selector, count) => {
        await page.waitForFunction(
          ([css, wanted]) => document.querySelectorAll(css).length === wanted,
          [selector, count],
        );
      };
      const view = page.locator(".menu summary", { hasText: "View" });
      await view.click();
      await shows(".menu[open]", 1);
      await page.locator(".stage").click({ position: { x: 200, y: 700 } });
      await shows(".menu[open]", 0);
      await view.click();
      await page.keyboard.press("Escape");
      await shows(".menu[open]", 0);
      // The panel: Escape, a tap on the picture, its button.
      const panel = page.getByRole("button", { name: "Panel" });
      await panel.click();
      await shows(".side", 1);
      await page.keyboard.press("Escape");
      await shows(".side", 0);
      await panel.click();
      await page.locator(".stage").click({ position: { x: 200, y: 100 } });
      await shows(".side", 0);
      await panel.click();
      await page.locator(".side").getByRole("button", { name: "Close" }).click();
      await shows(".side", 0);
      // The keys: Escape, and a press beside them.
      await page.keyboard.press("?");
      await shows("dialog[open]", 1);
      await page.keyboard.press("Escape");
      await shows("dialog[open]", 0);
      await page.keyboard.press("?");
      await shows("dialog[open]", 1);
      // A press that comes before the dialog is painted meets what is below it.
      await page.waitForFunction(() => document.elementFromPoint(195, 4)?.tagName === "DIALOG");
      await page.mouse.click(195, 4);
      await shows("dialog[open]", 0);
      // The gallery.
      await page.locator(".menu summary").first().click();
      await page.getByRole("button", { name: "Gallery …" }).click();
      await shows(".gallery", 1);
      assert.deepEqual(await misfits(page), []);
      await page.keyboard.press("Escape");
      await shows(".gallery", 0);
    }),
);

test("two fingers move and come closer", { timeout: PATIENCE }, async () => {
  const server = await serve(...CORNELL);
  try {
    const { page } = await open(server.url, () => {}, PHONE);
    await isDone(page);
    const session = await page.context().newCDPSession(page);
    const touch = (type, points) =>
      session.send("Input.dispatchTouchEvent", {
        type,
        touchPoints: points.map(([x, y], id) => ({ x, y, id })),
      });
    const kept = () => page.evaluate(() => document.querySelector("canvas").dataset.frame);
    const before = await kept();
    await touch("touchStart", [
      [150, 400],
      [240, 400],
    ]);
    for (let i = 1; i <= 10; i++) {
      await touch("touchMove", [
        [150 - 6 * i, 400],
        [240 + 6 * i, 400],
      ]);
    }
    await touch("touchEnd", []);
    await page.waitForFunction((n) => document.querySelector("canvas").dataset.frame !== n, before);
    await isDone(page);
    assert.equal(await page.locator(".facts").count(), 0, "it was no tap");
    await page.close();
  } finally {
    await server.stop();
  }
});

test("one message at a time", { timeout: PATIENCE }, () =>
  within(CORNELL, async (page) => {
    await isDone(page);
    for (let i = 0; i < 3; i++) {
      await page.setInputFiles("input[type=file] >> nth=0", {
        name: `broken${i}.ply`,
        mimeType: "",
        buffer: Buffer.from("ply\nnonsense"),
      });
      await page.waitForFunction(
        (n) => document.querySelector(".notices").textContent.includes(`broken${n}.ply`),
        i,
      );
      assert.equal(await page.locator(".notices p").count(), 1);
    }
  }),
);

test("every control has a name", { timeout: PATIENCE * 2 }, () =>
  within(
    CORNELL,
    async (page) => {
      await isDone(page);
      const box = await page.locator(".stage").boundingBox();
      await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
      await page.locator(".facts").waitFor();
      await page.evaluate(() => {
        for (const details of document.querySelectorAll("details")) details.open = true;
      });
      assert.deepEqual(await nameless(page), []);
      await page.keyboard.press("?");
      await page.locator("dialog[open]").waitFor();
      assert.deepEqual(await nameless(page), []);
    },
    { width: 1280, height: 800 },
  ),
);
