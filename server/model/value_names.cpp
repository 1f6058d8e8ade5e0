#include "server/model/value_names.h"

#include "server/model/finger_name.h"

namespace touchstone::model {

std::string NameOf(const Effect& effect) {
  if (effect.lookup) return "lookup " + effect.lookup->name;
  return effect.formula ? "formula " + effect.formula->name : effect.name;
}

std::string EntryName(const ParameterInfo& parameter, int entry, int fingers) {
  if (parameter.arity == Arity::kVector3 || parameter.arity == Arity::kVector2)
    return std::string(1, "xyz"[entry]);
  if (parameter.arity == Arity::kPerFinger) return FingerName(entry, fingers);
  return "";
}

}  // namespace touchstone::model
