// The page without a server.

import "./install";
import { store } from "../main";
import { follow } from "./follow";
import { first } from "./install";

void follow(store, document.location.hash, first);
window.addEventListener("hashchange", () => void follow(store, document.location.hash, null));
