// The parameters of one thing of a family, such as a material: its kind first, then what matters
// most, then the rest.

import type { ComponentChildren, JSX } from "preact";
import {
  colorIn,
  Field,
  type FieldProps,
  type Fields,
  inside,
  isFields,
  type Json,
  order,
  readable,
} from "../form";
import type { Form } from "../protocol.gen";
import { choices, type Store } from "../store";
import { Select } from "./section";
import { TextureSlot } from "./texture";

/** A kind with more parameters than this is shown in groups of those that begin alike. */
const MANY = 12;

/** The kind of a thing, by the form of its family. */
export const kindOf = (form: Form, thing: Fields): string => {
  const held = isFields(thing.kind) ? thing.kind : thing;
  return String(held[form.tag] ?? "");
};

/** A thing of another kind, which keeps the colour. */
export function ofKind(family: string, before: Fields, kind: string): Fields {
  const form = choices.value!.forms[family]!;
  const next = { ...(choices.value!.examples[family]![kind] as Fields) };
  const colors = [kindOf(form, before), kind].map((name) => colorIn(form.kinds[name] ?? []));
  const [old, own] = colors.map((color) => color?.name ?? "");
  const color = isFields(before.kind) ? before.kind[old!] : before[old!];
  if (!color || !own || !(own in next)) return next;
  const bare = isFields(color) ? color.factor! : color;
  next[own] = isFields(next[own])
    ? {
        ...(next[own] as Fields),
        factor: bare,
        ...(isFields(color) && { texture: color.texture! }),
      }
    : bare;
  // Other parameters than a colour keep what they are in both kinds.
  return next;
}

/** Kinds of a family as a list. */
export function KindSelect(props: {
  family: string;
  label: string;
  now: string;
  /** The first line, where nothing is chosen yet. */
  none?: string;
  change(kind: string): void;
}): JSX.Element | null {
  const form = choices.value?.forms[props.family];
  if (!form) return null;
  const options = form.options.map((name) => ({ value: name, text: readable(name) }));
  const none = props.none ? [{ value: "", text: props.none }] : [];
  return (
    <Select
      label={props.label}
      value={props.now}
      options={[...none, ...options]}
      change={(kind) => kind !== "" && props.change(kind)}
      title={form.docs[props.now]}
    />
  );
}

/** A list of parameters whose names begin alike, shown in a group that can be folded. */
function groups(names: string[]): { title: string; names: string[] }[] {
  const list: { title: string; names: string[] }[] = [];
  for (const name of names) {
    const title = name.startsWith("thin_film") ? "thin film" : name.split("_")[0]!;
    const last = list.at(-1);
    if (last?.title === title) last.names.push(name);
    else list.push({ title, names: [name] });
  }
  return list;
}

/** True if nothing in a group differs from its default. */
const isPlain = (names: string[], value: Fields, form: Form): boolean =>
  names.every((name) => {
    const field = inside(form, value, name);
    return !field || JSON.stringify(field.default) === JSON.stringify(value[name]);
  });

/** The fields of a thing's own kind. */
function KindFields(props: {
  value: Fields;
  form: Form;
  field(name: string, value: Json, form: Form | undefined, short?: string): ComponentChildren;
}): JSX.Element {
  const { value, form } = props;
  const kind = String(value[form.tag]);
  const all = order({ ...form, fields: [] }, value).filter((name) => name !== form.tag);
  const color = colorIn(form.kinds[kind] ?? [])?.name;
  const names = [...all.filter((n) => n === color), ...all.filter((n) => n !== color)];
  const field = (name: string, short?: string): ComponentChildren =>
    props.field(name, value[name]!, inside(form, value, name), short);
  if (names.length <= MANY) return <>{names.map((name) => field(name))}</>;
  return (
    <>
      {groups(names).map(({ title, names }, i) => (
        <details class="more" open={i < 2 || !isPlain(names, value, form)}>
          <summary>{title}</summary>
          {names.map((name) => field(name, readable(name).slice(title.length + 1) || name))}
        </details>
      ))}
    </>
  );
}

/** Common parameters that matter to most people; the others are under "More". */
const FIRST = ["emission", "alpha", "alpha_mode", "normal_map"];

/** All parameters of one thing. */
export function Thing(props: {
  family: string;
  index: number;
  thing: Fields;
  store: Store;
  /** Makes the thing one of another kind. */
  changeKind(kind: string): void;
}): JSX.Element | null {
  const { family, index, thing, store } = props;
  const form = choices.value?.forms[family];
  if (!form) return null;
  const change = (path: string, value: Json): void =>
    store.edit(`${family}.${index}${path}`, value);
  const texture: FieldProps["texture"] = (place) => (
    <TextureSlot
      place={place}
      store={store}
      set={(value, before) => store.edits([...before, [`${family}.${index}${place.path}`, value]])}
    />
  );
  const at = (path: string) => (name: string, value: Json, own?: Form, short?: string) => (
    <Field
      key={`${index}.${name}`}
      label={name}
      short={short}
      value={value}
      path={`${path}.${name}`}
      change={change}
      form={own}
      texture={texture}
    />
  );
  const whole = isFields(thing.kind) ? thing.kind : thing;
  // What stands beside the kind is common to all kinds.
  const common = isFields(thing.kind)
    ? order({ ...form, tag: "" }, thing).filter((name) => name !== "kind" && name !== "name")
    : [];
  const one = (name: string): ComponentChildren =>
    at("")(
      name,
      thing[name]!,
      form.fields.find((field) => field.name === name),
    );
  const rest = common.filter((name) => !FIRST.includes(name));
  return (
    <>
      <KindSelect
        family={family}
        label="Kind"
        now={kindOf(form, thing)}
        change={props.changeKind}
      />
      <KindFields value={whole} form={form} field={at(isFields(thing.kind) ? ".kind" : "")} />
      {FIRST.filter((name) => common.includes(name)).map(one)}
      {rest.length > 0 && (
        <details class="more">
          <summary>More</summary>
          {rest.map(one)}
        </details>
      )}
    </>
  );
}
