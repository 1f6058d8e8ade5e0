// touchstone-effector-host: an end effector without hardware. Prints the path of its pseudo-terminal; takes
// these lines:
//   press N, release N   finger N, from 0
//   sample N VALUE       of an analogue finger
//   quit                 or the end of the input
#include <cstdio>
#include <cstring>
#include <string>

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include "firmware/host/pty_effector.h"

namespace {

using touchstone::firmware::kMaxFingers;
using touchstone::firmware::PtyEffector;

// False if it is time to go.
bool Obey(const std::string& line, PtyEffector* effector) {
  int finger = -1;
  unsigned value = 0;
  char word[16] = {};
  const int count = std::sscanf(line.c_str(), "%15s %d %u", word, &finger, &value);
  if (count <= 0) return true;
  const bool good_finger = count >= 2 && finger >= 0 && finger < kMaxFingers;
  if (std::strcmp(word, "quit") == 0) return false;
  if (good_finger && (std::strcmp(word, "press") == 0 || std::strcmp(word, "release") == 0)) {
    effector->Press(finger, word[0] == 'p');
  } else if (good_finger && count == 3 && value <= 65535 && std::strcmp(word, "sample") == 0) {
    effector->Sample(finger, static_cast<uint16_t>(value));
  } else {
    std::fprintf(stderr, "'%s' is no command; press N, release N, sample N VALUE (N from 0 to %d) or quit\n",
                 line.c_str(), kMaxFingers - 1);
  }
  return true;
}

}  // namespace

int main() {
  std::string error;
  const auto effector = PtyEffector::Open(&error);
  if (effector == nullptr) {
    std::fprintf(stderr, "touchstone-effector-host: %s\n", error.c_str());
    return 1;
  }
  std::printf("%s\n", effector->path().c_str());
  std::fflush(stdout);

  std::string line;
  for (;;) {
    pollfd ready[2] = {{STDIN_FILENO, POLLIN, 0}, {effector->fd(), POLLIN, 0}};
    poll(ready, 2, 1);
    effector->Run();
    if (ready[0].revents == 0) continue;
    char bytes[256];
    const ssize_t size = read(STDIN_FILENO, bytes, sizeof(bytes));
    if (size <= 0) return 0;
    for (ssize_t i = 0; i < size; ++i) {
      if (bytes[i] != '\n') {
        line += bytes[i];
      } else {
        if (!Obey(line, effector.get())) return 0;
        line.clear();
      }
    }
  }
}
