// How --help is laid out: what the command is, examples, then usage and options.
#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

namespace touchstone::cli {

// `examples`: one per line.
std::shared_ptr<CLI::FormatterBase> ExamplesFirst(const std::string& examples);

}  // namespace touchstone::cli
