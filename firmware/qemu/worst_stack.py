"""The most stack that the core's public functions can take: the longest way down the call graph.

    worst_stack.py --max BYTES FILE.ci ...

The files are GCC's (-fcallgraph-info=su): every function with the bytes of its own frame, every call as an edge. A
cycle, a frame of unknown size or a call of an unknown function is an error, since then there is no bound. Calls through
a pointer are the two functions that the hardware layer gives (write a frame, read the counter): their stack is the
layer's own and comes on top.
"""
import argparse
import re
import sys

# Of the compiler's library, without a call graph: more than they take, as read from the disassembly.
LIBRARY_BYTES = {"memcpy": 64, "memset": 64, "memmove": 64, "__aeabi_uldivmod": 96, "__aeabi_ldivmod": 96,
                 "__aeabi_memcpy": 64, "__aeabi_memclr": 64}
INDIRECT = "__indirect_call"
# What a hardware layer calls.
ENTRY = re.compile(r"Effector::(Effector|OnByte|OnEdge|OnAnalogue|OnTime)\(")


def read(paths):
    frames, labels, calls = {}, {}, {}
    for path in paths:
        with open(path, encoding="utf-8") as file:
            for line in file:
                node = re.match(r'node: \{ title: "([^"]*)" label: "([^"]*)"', line)
                edge = re.match(r'edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"', line)
                if node:
                    name, label = node.groups()
                    size = re.search(r"(\d+) bytes \((\w+(?:,\w+)?)\)", label)
                    if size:
                        if size.group(2) != "static":
                            sys.exit(f"worst_stack: the frame of {name} is {size.group(2)}: it has no bound")
                        frames[name] = int(size.group(1))
                        labels[name] = label.split("\\n")[0]
                elif edge:
                    calls.setdefault(edge.group(1), set()).add(edge.group(2))
    return frames, labels, calls


def deepest(name, frames, calls, known, under_way):
    """(bytes, way) of the longest way down from this function."""
    if name in known:
        return known[name]
    short = name.split(":")[-1]
    if name not in frames:
        if short == INDIRECT:
            return 0, ["(the hardware layer)"]
        if short not in LIBRARY_BYTES:
            sys.exit(f"worst_stack: {short} is called and its stack is not known")
        return LIBRARY_BYTES[short], [short]
    if name in under_way:
        sys.exit(f"worst_stack: {name} calls itself: the stack has no bound")
    below, way = 0, []
    for callee in calls.get(name, ()):
        size, rest = deepest(callee, frames, calls, known, under_way | {name})
        if size > below or not way:
            below, way = size, rest
    known[name] = frames[name] + below, [f"{name} {frames[name]}"] + way
    return known[name]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--max", type=int, required=True, metavar="BYTES")
    parser.add_argument("files", nargs="+", metavar="FILE.ci")
    options = parser.parse_args()
    frames, labels, calls = read(options.files)
    known, worst = {}, (0, [])
    entries = [name for name in frames if ENTRY.search(labels[name])]
    if len(entries) < 5:
        sys.exit(f"worst_stack: found {len(entries)} of the core's public functions, expected 5")
    for name in entries:
        worst = max(worst, deepest(name, frames, calls, known, frozenset()))
    print(f"Worst-case stack of the core: {worst[0]} bytes of {options.max} allowed, by the way")
    for step in worst[1]:
        print(f"  {step}")
    return worst[0] > options.max


if __name__ == "__main__":
    sys.exit(main())
