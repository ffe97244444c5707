// A server of files, as the page without a server needs one, and the page on it.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { folder, open, PATIENCE, SNELL } from "../browser.mjs";

const PAGE = new URL("../../../target/page/", import.meta.url).pathname;

const TYPES = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".jpg": "image/jpeg",
};

/** Serves the page in `page/`, and other files by their names: pairs of a name and bytes. */
export async function site(files = {}) {
  const server = createServer((request, response) => {
    const path = decodeURIComponent(new URL(request.url, "http://x").pathname).slice(1);
    const name = path === "page/" ? "page/index.html" : path;
    try {
      const inPage = name.startsWith("page/") && join(PAGE, normalize(`/${name.slice(5)}`));
      const bytes = inPage ? readFileSync(inPage) : files[name];
      if (bytes === undefined) throw new Error("there is no such file");
      const type = TYPES[extname(name)] ?? "application/octet-stream";
      response.writeHead(200, { "content-type": type, "content-length": bytes.length });
      response.end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const url = `http://127.0.0.1:${server.address().port}/`;
  return { url, page: `${url}page/`, stop: () => server.close() };
}

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
