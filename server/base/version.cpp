#include "server/base/version.h"

namespace touchstone {

const char kVersion[] = TOUCHSTONE_VERSION;

}  // namespace touchstone
