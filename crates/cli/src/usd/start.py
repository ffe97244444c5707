import contextlib
import importlib.abc
import importlib.machinery
import os
import signal
import site
import sys
import threading


def end_with_the_parent():
    # The parent's end of the pipe closes when the parent ends, in whatever way.
    while os.read(0, 1):
        pass
    os._exit(1)


def set_limits():
    try:
        import resource
    except ImportError:
        return

    def limit(kind, most):
        known = [value for value in resource.getrlimit(kind) if value != resource.RLIM_INFINITY]
        resource.setrlimit(kind, (min([most, *known]), resource.getrlimit(kind)[1]))

    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        with open("/sys/fs/cgroup/memory.max") as file:
            memory = min(memory, int(file.read()))
    except (OSError, ValueError):
        pass
    # The last quarter is for the scene, which grows in the parent. Mapped files and space that is
    # only reserved count towards the limit on addresses alone.
    memory = memory // 4 * 3
    for kind, most in (
        ("RLIMIT_DATA", memory),
        ("RLIMIT_AS", memory + (256 << 30)),
        ("RLIMIT_CORE", 0),
    ):
        with contextlib.suppress(AttributeError, OSError, ValueError):
            limit(getattr(resource, kind), most)


class Carried(importlib.abc.MetaPathFinder, importlib.abc.InspectLoader):
    def find_spec(self, name, path=None, target=None):
        if name not in TEXTS:
            return None
        is_package = self.is_package(name)
        return importlib.machinery.ModuleSpec(name, self, origin=name, is_package=is_package)

    def is_package(self, name):
        return name == "snell_usd"

    def get_source(self, name):
        return TEXTS[name]


signal.signal(signal.SIGINT, signal.SIG_DFL)
threading.Thread(target=end_with_the_parent, daemon=True).start()
set_limits()
# Only the scene goes to standard output; what libraries print goes to standard error.
sys.stdout = open(os.dup(1), "w", encoding="utf-8", newline="\n")
os.dup2(2, 1)
# An isolated Python ignores the packages that the user installed without administrator rights (pip
# install --user). Their folder is added here; nothing in it runs before it is imported.
if sys.prefix == sys.base_prefix and os.path.isabs(site.getusersitepackages()):
    sys.path.append(site.getusersitepackages())
sys.meta_path.insert(0, Carried())
from snell_usd.__main__ import main

code = main(sys.argv[3:], sys.argv[2])
sys.stdout.flush()
sys.stderr.flush()
# This skips the destruction of USD, which takes long and may crash while the threads of USD still
# run.
os._exit(code)
