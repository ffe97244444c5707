// The texture of a parameter, as a small picture: another is dropped on it, or chosen.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { filesOf } from "../drop";
import { type Fields, type Json, readable, type TexturePlace } from "../form";
import { host } from "../host";
import { isLight, isPicture, sendPicture } from "../send";
import { choices, type Store, scene } from "../store";

type Edit = [string, unknown];

/** Patterns that stand for themselves: others mix textures, which the scene may not have. */
function patterns(): string[] {
  const forms = choices.value?.forms.pattern;
  const isAlone = (kind: string): boolean =>
    !/"texture":\d/.test(JSON.stringify(choices.value?.examples.pattern?.[kind] ?? {}));
  return forms?.options.filter(isAlone) ?? [];
}

/** A small picture of a texture of the scene. */
function Swatch(props: { texture: number; generation: number; title: string }): JSX.Element {
  const { texture, generation, title } = props;
  const address = useSignal("");
  useEffect(() => {
    let [isOver, made] = [false, ""];
    const show = async (): Promise<void> => {
      const response = await host.ask(`texture?i=${texture}&generation=${generation}`);
      if (isOver || !response.ok) return;
      made = URL.createObjectURL(await response.blob());
      address.value = made;
    };
    // Without an answer, there is the name.
    show().catch(() => {});
    return () => {
      isOver = true;
      URL.revokeObjectURL(made);
    };
  }, [texture, generation]);
  return <img src={address.value || undefined} alt={title} width="24" height="24" />;
}

export function TextureSlot(props: {
  place: TexturePlace;
  store: Store;
  /** Sets the parameter's texture, after these changes. */
  set(value: Json, before: Edit[]): void;
}): JSX.Element {
  const { place, store, set } = props;
  const input = useRef<HTMLInputElement>(null);
  const over = useSignal(false);
  const open = useSignal(false);
  const info = scene.value!;
  const held = place.texture === null ? undefined : (info.textures[place.texture] as Fields);
  const next = info.textures.length;
  const usePicture = async (file: File | undefined): Promise<void> => {
    if (!file) return;
    if (!isPicture(file.name)) {
      store.notice(`${file.name} is no picture that a surface could have`);
      return;
    }
    const name = await sendPicture(store, file);
    if (name === null) return;
    const now = scene.value!;
    const like = held && "image" in held ? held : now.new_texture;
    // Data, such as roughness, is stored as it is; colours have the sRGB curve, unless they are
    // light.
    const encoding = place.isColor && !isLight(file.name) ? "srgb" : "linear";
    const texture = { ...like, image: now.images, encoding };
    open.value = false;
    set(place.with(now.textures.length), [
      [`image.${now.images}`, name],
      [`texture.${now.textures.length}`, texture],
    ]);
  };
  const usePattern = (kind: string): void => {
    open.value = false;
    set(place.with(next), [[`texture.${next}`, choices.value!.examples.pattern![kind]]]);
  };
  const title = held
    ? `${place.label}: ${held.pattern ? readable(String(held.pattern)) : "a picture"}`
    : `${place.label}: no texture`;
  return (
    <fieldset
      aria-label={`${place.label}: texture`}
      class={over.value ? "slot over" : "slot"}
      onDragOver={(e) => {
        e.preventDefault();
        over.value = true;
      }}
      onDragLeave={() => (over.value = false)}
      onDrop={(e) => {
        e.preventDefault();
        e.stopPropagation();
        over.value = false;
        if (e.dataTransfer)
          void filesOf(e.dataTransfer).then((files) => usePicture(files[0]?.file));
      }}
    >
      <button
        aria-label={`texture of ${place.label}`}
        aria-expanded={open.value}
        title={`${title}; drop a picture here, or click`}
        onClick={() => (open.value = !open.value)}
      >
        {place.texture === null ? (
          "+"
        ) : (
          <Swatch texture={place.texture} generation={info.generation} title={title} />
        )}
      </button>
      {open.value && (
        <fieldset class="choose" aria-label={`choose the texture of ${place.label}`}>
          <button onClick={() => input.current?.click()}>Picture …</button>
          <select
            aria-label={`pattern of ${place.label}`}
            value=""
            onChange={(e) => e.currentTarget.value && usePattern(e.currentTarget.value)}
          >
            <option value="">Pattern …</option>
            {patterns().map((kind) => (
              <option value={kind}>{readable(kind)}</option>
            ))}
          </select>
          {place.texture !== null && (
            <button
              onClick={() => {
                open.value = false;
                set(null, []);
              }}
            >
              Remove
            </button>
          )}
        </fieldset>
      )}
      <input
        ref={input}
        type="file"
        accept="image/*,.hdr,.exr,.ktx2,.dds,.tga"
        hidden
        aria-label={`picture for ${place.label}`}
        onChange={(e) => {
          void usePicture(e.currentTarget.files?.[0]);
          e.currentTarget.value = "";
        }}
      />
    </fieldset>
  );
}
