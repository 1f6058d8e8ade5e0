#include "server/base/numbers/rule.h"

#ifdef TOUCHSTONE_CHANGEABLE_RULES

#include <cstdlib>
#include <string>

namespace touchstone {
namespace {

struct Change {
  std::string name;
  double number = 0;
};

Change ReadChange() {
  const char* text = std::getenv("TOUCHSTONE_RULE");
  const char* equals = text == nullptr ? nullptr : std::strchr(text, '=');
  if (equals == nullptr) return {};
  return {std::string(text, equals), std::strtod(equals + 1, nullptr)};
}

}  // namespace

double ChangedNumber(const char* name, double number) {
  static const Change change = ReadChange();
  return change.name == name ? change.number : number;
}

}  // namespace touchstone

#endif
