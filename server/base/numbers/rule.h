// Numbers by which the program decides: thresholds, limits of work, sizes of grids. Each stands once, in the struct of its
// room (rules.h in the folder), with what a reader must know before changing it.
#pragma once

#include <cstring>
#include <type_traits>
#include <vector>

namespace touchstone {

// `T` is what the number is used as: double, int or size_t. All structs of rules have this layout and no other member, so that
// one function lists any of them.
template <typename T>
struct Rule {
  const char* name;     // folder and member, "engine.fit.converged"
  double number;        // in `unit`
  const char* unit;     // "nats", "probability", "standard errors"; "" for counts and ratios
  const char* decides;  // what the number decides
  const char*
      chosen;  // where it comes from: an argument, the sets on which it was chosen, a test that holds it
  const char*
      beyond;  // what goes wrong where it is smaller or larger; "Not measured." where nobody has tried

#ifdef TOUCHSTONE_CHANGEABLE_RULES
  T value() const;
  operator T() const {
    return value();
  }
#else
  constexpr T value() const {
    return static_cast<T>(number);
  }
  constexpr operator T() const {
    return value();
  }
#endif
};

#ifdef TOUCHSTONE_CHANGEABLE_RULES
// `number`, or what the environment variable TOUCHSTONE_RULE ("NAME=NUMBER") has for the rule of this name. For the program that
// measures what each number changes (tests/rules); no other build has it.
double ChangedNumber(const char* name, double number);

template <typename T>
T Rule<T>::value() const {
  return static_cast<T>(ChangedNumber(name, number));
}
#endif

// The rules of a struct, in the order in which it declares them.
template <typename Rules>
std::vector<Rule<double>> ListRules(const Rules& rules) {
  static_assert(std::is_trivially_copyable_v<Rules> && sizeof(Rules) % sizeof(Rule<double>) == 0 &&
                sizeof(Rule<int>) == sizeof(Rule<double>));
  std::vector<Rule<double>> rows(sizeof(Rules) / sizeof(Rule<double>));
  std::memcpy(static_cast<void*>(rows.data()), &rules, sizeof(Rules));
  return rows;
}

}  // namespace touchstone
