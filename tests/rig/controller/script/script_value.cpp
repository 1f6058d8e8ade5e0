#include "tests/rig/controller/script/script_value.h"

#include <cmath>
#include <cstdio>

namespace touchstone::rig {

double Value::AsNumber(const std::string& what) const {
  if (kind != Kind::kNumber) throw ScriptError(what + " must be a number, is " + ToText());
  return number;
}

bool Value::AsBool(const std::string& what) const {
  if (kind != Kind::kBool) throw ScriptError(what + " must be True or False, is " + ToText());
  return number != 0;
}

int Value::AsInteger(const std::string& what) const {
  const double value = AsNumber(what);
  if (!(std::abs(value) <= 2147483648.0) || value != std::floor(value) || value > 2147483647.0)
    throw ScriptError(what + " must be an integer, is " + ToText());
  return static_cast<int>(value);
}

const std::string& Value::AsString(const std::string& what) const {
  if (kind != Kind::kString) throw ScriptError(what + " must be a string, is " + ToText());
  return text;
}

Vector6 Value::AsSix(const std::string& what) const {
  if ((kind != Kind::kList && kind != Kind::kPose) || items.size() != 6)
    throw ScriptError(what + " must be a pose or a list of six numbers, is " + ToText());
  Vector6 six;
  for (int i = 0; i < 6; ++i) {
    six[i] = items[i].AsNumber(what + "[" + std::to_string(i) + "]");
    if (!std::isfinite(six[i])) throw ScriptError(what + " must be finite, is " + ToText());
  }
  return six;
}

bool Value::operator==(const Value& other) const {
  return kind == other.kind && number == other.number && text == other.text && items == other.items;
}

std::string Value::ToText() const {
  switch (kind) {
    case Kind::kNone:
      return "None";
    case Kind::kBool:
      return number != 0 ? "True" : "False";
    case Kind::kNumber: {
      char buffer[40];
      std::snprintf(buffer, sizeof buffer, "%.9g", number);
      return buffer;
    }
    case Kind::kString:
      return text;
    case Kind::kThread:
      return "thread " + std::to_string(static_cast<int>(number));
    case Kind::kList:
    case Kind::kPose: {
      std::string all = kind == Kind::kPose ? "p[" : "[";
      for (size_t i = 0; i < items.size(); ++i) all += (i ? ", " : "") + items[i].ToText();
      return all + "]";
    }
  }
  return "";
}

}  // namespace touchstone::rig
