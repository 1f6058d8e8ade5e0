// How much memory this process may have before the kernel ends it.
#pragma once

#include <cstdint>
#include <string>

namespace touchstone {

// The smallest memory limit, in bytes, of the control group of this process and of all groups around it, in the hierarchies of
// version 1, version 2 and both beside one another; UINT64_MAX where none limits it. Inside a container those are the
// groups that the container sees. `root` is where /proc and the mounts are looked for. Sources: cgroups(7),
// proc_pid_mountinfo(5), Documentation/admin-guide/cgroup-v2.rst of Linux.
uint64_t CgroupMemoryBytes(const std::string& root = "");

// That, or the memory of the machine where that is less.
uint64_t MemoryLimitBytes();

}  // namespace touchstone
