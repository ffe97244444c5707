// A server of files, as the page without a server needs one.

import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

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
