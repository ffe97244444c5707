// Saving the scene with all that was changed.

import { host } from "./host";
import { type Store, scene } from "./store";

/** Saves the scene in a format, and says what the format leaves out. */
export async function saveScene(store: Store, format: "snell" | "glb"): Promise<void> {
  const response = await host.ask(`scene?format=${format}`);
  if (!response.ok) {
    store.notice((await response.text()).trim());
    return;
  }
  const name = `${scene.value?.name.replace(/[^A-Za-z0-9]/g, "-") || "scene"}.${format}`;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await response.blob());
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
  const losses = response.headers.get("snell-losses");
  store.notice(losses ? `${name}: ${losses}` : `${name} holds the scene as it is shown`);
}
