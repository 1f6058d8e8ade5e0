// Texts as YAML scalars.
#pragma once

#include <string>

namespace touchstone::model {

// Without quotes where no reader could take the text for anything but a text; else in double quotes, with what YAML would
// take apart escaped.
std::string YamlText(const std::string& text);
// Always in quotes.
std::string QuotedYamlText(const std::string& text);

}  // namespace touchstone::model
