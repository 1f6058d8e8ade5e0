// The portable core, for a tool that compiles only what lies in the sketch's folder. The repository's root
// has to be on the include path (README.md).
#include "firmware/core/debouncer.cpp"
#include "firmware/core/effector.cpp"
#include "firmware/core/effector_requests.cpp"
#include "firmware/core/frame.cpp"
#include "firmware/core/messages.cpp"
#include "firmware/core/ticks.cpp"
