// Opening what an address or a link names, and making links.

import { effect } from "@preact/signals";
import { copyText } from "../save";
import { openFiles } from "../send";
import { busy, connected, gallery, rig, type Store, scene, view } from "../store";
import { fetchScene } from "./files";
import { isAddress, type Link, linkTo, parseLink } from "./link";
import { from, origin } from "./origin";

/** Opens the scene at an address; false if that fails, which is said. */
export async function openAddress(store: Store, address: string): Promise<boolean> {
  try {
    const url = new URL(address, document.baseURI).href;
    const files = await fetchScene(url, (text) => (busy.value = text));
    busy.value = "opening the scene";
    const named = files.map(({ path, bytes }) => ({
      path,
      file: new File([bytes], path.split("/").at(-1)!),
    }));
    return await from(url, () => openFiles(store, named));
  } catch (error) {
    store.notice(error instanceof Error ? error.message : String(error));
    return false;
  } finally {
    busy.value = "";
  }
}

/** Resolves when there is a view with a scene. */
function shown(): Promise<void> {
  return new Promise((resolve) => {
    const stop = effect(() => {
      if (!connected.value || !view.value || !scene.value || !rig.value) return;
      queueMicrotask(() => stop());
      resolve();
    });
  });
}

/** Sets what a link says of the camera and of the render. */
function set(store: Store, link: Link): void {
  const { integrator, spp, max_depth, aov, accelerator, exposure, tonemap } = link;
  store.send({ type: "render", integrator, spp, max_depth, aov, accelerator });
  for (const [name, value] of Object.entries(link.settings))
    store.send({ type: "set", name, value });
  if (exposure !== undefined || tonemap !== undefined) store.setDisplay({ exposure, tonemap });
  if (link.camera) store.setCamera(link.camera);
}

/** Shows what a link says. `first` is the built-in scene that the renderer begins with. */
export async function follow(store: Store, hash: string, first: string | null): Promise<void> {
  const { link, problems } = parseLink(hash);
  if (!link) return;
  await shown();
  gallery.value = false;
  let isOpen = link.scene === first;
  if (isAddress(link.scene)) isOpen = await openAddress(store, link.scene);
  else if (!isOpen) isOpen = await store.open(`builtin=${encodeURIComponent(link.scene)}`);
  if (!isOpen) return;
  await shown();
  set(store, link);
  if (problems.length > 0)
    store.notice(`The link was not understood wholly: ${problems.join(", ")}`);
}

/** Copies a link to what is shown, and puts it into the address of the page. */
export async function copyLink(store: Store): Promise<void> {
  // The view says what rests.
  await store.rested();
  const [from, camera, now] = [origin.value, rig.value?.camera, view.value];
  if (!from || !camera || !now) {
    store.notice(
      "A link cannot carry a scene from your disk: put the file on the web, and open it by its " +
        "address",
    );
    return;
  }
  const here = document.location.href.replace(/[?#].*/, "");
  const link = `${here}${linkTo(from, camera, now)}`;
  history.replaceState(null, "", link);
  await copyText(store, link);
  if (/ -D /.test(now.command.replace(/ -D '?camera\./g, " ")))
    store.notice("The link holds scene, camera and settings, but no changes of the scene: save it");
}
