// What a variable of a script can be.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "tests/rig/controller/script/kinematics.h"

namespace touchstone::rig {

// A script does what it must not; ends the program with an exception message.
struct ScriptError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Value {
  enum class Kind { kNone, kBool, kNumber, kString, kList, kPose, kThread };
  Kind kind = Kind::kNone;
  double number = 0;  // kBool: 0 or 1; kThread: its handle
  std::string text;
  std::vector<Value> items;  // kList; kPose: six numbers

  static Value Bool(bool yes) { return {Kind::kBool, yes ? 1.0 : 0.0, {}, {}}; }
  static Value Number(double number) { return {Kind::kNumber, number, {}, {}}; }
  static Value String(std::string text) { return {Kind::kString, 0, std::move(text), {}}; }
  static Value List(std::vector<Value> items) { return {Kind::kList, 0, {}, std::move(items)}; }
  static Value Vector(const Vector6& six, Kind kind) {
    Value value{kind, 0, {}, {}};
    for (int i = 0; i < 6; ++i) value.items.push_back(Number(six[i]));
    return value;
  }

  // Each throws ScriptError, naming `what`, if it is of another kind.
  double AsNumber(const std::string& what) const;
  bool AsBool(const std::string& what) const;
  int AsInteger(const std::string& what) const;
  const std::string& AsString(const std::string& what) const;
  Vector6 AsSix(const std::string& what) const;  // a pose or a list of six numbers
  bool operator==(const Value& other) const;
  std::string ToText() const;  // as textmsg writes it
};

}  // namespace touchstone::rig
