// What a program does that gets no more memory: it says so and ends with a status, instead of being aborted without a word.
#pragma once

#include <cstdint>
#include <functional>

namespace touchstone {

// Runs a program. Where std::bad_alloc reaches this, everything is left in order (files that are not finished go) and `status` is
// returned, with one line on standard error that `program`, a literal, begins. Where another thread or a library that knows
// no other way than abort() gets none, the process ends at once, likewise.
int RunWithinMemory(const char* program, int status, const std::function<int()>& run);

// How often operator new has failed in this process since RunWithinMemory began.
uint64_t OutOfMemoryCount();

}  // namespace touchstone
