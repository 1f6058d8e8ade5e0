#include "server/base/process/out_of_memory.h"

#include <signal.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

namespace touchstone {
namespace {

// What a thread's stack and an arena of malloc take of the address space.
constexpr size_t kScarceBytes = size_t{64} << 20;
constexpr char kWords[] =
    ": error: there is not enough memory (limit of this process, container or machine); give it more, or ask "
    "for less at "
    "once\n";

const char* program_name = nullptr;  // null: before RunWithinMemory
int exit_status = 71;                // EX_OSERR
std::atomic<uint64_t> failures{0};

void CountAndThrow() {
  ++failures;
  throw std::bad_alloc();
}

// Without memory: a handler of signals may do this.
void Say() {
  const char* name = program_name != nullptr ? program_name : program_invocation_short_name;
  (void)!write(STDERR_FILENO, name, std::strlen(name));
  (void)!write(STDERR_FILENO, kWords, sizeof kWords - 1);
}

bool MemoryIsScarce() {
  void* const bytes = mmap(nullptr, kScarceBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (bytes == MAP_FAILED) return true;
  munmap(bytes, kScarceBytes);
  return false;
}

[[noreturn]] void EndNow() {
  Say();
  _exit(exit_status);
}

// A library that was refused memory calls abort(); so does what is wrong for another reason, which stays an abort.
void OnAbort(int) {
  if (MemoryIsScarce()) EndNow();
  signal(SIGABRT, SIG_DFL);
  raise(SIGABRT);
}

[[noreturn]] void OnTerminate() {
  try {
    if (std::current_exception()) std::rethrow_exception(std::current_exception());
  } catch (const std::bad_alloc&) {
    EndNow();
  } catch (...) {
  }
  std::abort();
}

void NoticeWantOfMemory() {
  std::set_terminate(OnTerminate);
  signal(SIGABRT, OnAbort);
}

// Libraries ask for memory in their constructors: before those, and so before main().
__attribute__((section(".preinit_array"), used)) void (*const before_libraries)() = NoticeWantOfMemory;

}  // namespace

uint64_t OutOfMemoryCount() {
  return failures;
}

int RunWithinMemory(const char* program, int status, const std::function<int()>& run) {
  program_name = program, exit_status = status;
  std::set_new_handler(CountAndThrow);
  NoticeWantOfMemory();
  try {
    return run();
  } catch (const std::bad_alloc&) {
    Say();
  } catch (const std::system_error& error) {
    // A thread needs a stack.
    if (error.code() != std::errc::resource_unavailable_try_again) throw;
    Say();
  }
  return status;
}

}  // namespace touchstone
