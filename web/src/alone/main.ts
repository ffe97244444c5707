// The page without a server.

import "./install";
import { store } from "../main";
import { follow } from "./follow";
import { first } from "./install";
import { asked } from "./link";

void follow(store, asked(), first);
window.addEventListener("hashchange", () => void follow(store, asked(), null));
