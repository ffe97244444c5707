// The page without a server, opened by a link.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { folder, open, PATIENCE, SNELL } from "../browser.mjs";
import { site } from "./server.mjs";

/** Does something on the page of a link once a picture is shown. */
export async function onAlone(link, act, { files, viewport } = {}) {
  const served = await site(files);
  try {
    const address = `${served.page}${link.replaceAll("SITE/", served.url)}`;
    const { page, faults } = await open(address, () => {}, viewport);
    await act(page, served);
    assert.deepEqual(
      faults.filter((fault) => !fault.includes("status of 4") && !/CORS|ERR_FAILED/.test(fault)),
      [],
    );
    await page.close();
  } finally {
    served.stop();
  }
}

/** The SHA-256 of the picture at rest. */
export async function sha256(page) {
  for (const end = Date.now() + PATIENCE; Date.now() < end; await page.waitForTimeout(100)) {
    const hash = await page.evaluate(async () => (await window.snell.ask("sha256")).text());
    if (hash !== "") return hash;
  }
  throw new Error("the picture never rested");
}

/** The SHA-256 of what a command renders. */
export function rendered(command, options = {}) {
  const stats = join(folder, "stats.json");
  const words = [...command.slice(1), "--stats", stats, "-o", join(folder, "native.exr"), "-q"];
  execFileSync(SNELL, words, options);
  return JSON.parse(readFileSync(stats, "utf8")).image_sha256;
}
