// touchstone-hidden-generator: the oracle for `touchstone rehearse --generator`.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <stdexcept>

#include "server/base/files/file_writer.h"
#include "tests/hidden_effects/generator/program.h"

int main(int argc, char** argv) {
  using namespace touchstone;
  hidden::GeneratorRequest request;
  std::string output;
  std::vector<std::string> meshes;
  int session = 1, sessions = 1;
  CLI::App app{"A measurement file of a plan, by a simulation that shares nothing with the product's."};
  app.add_option("--plan", request.plan)->required();
  app.add_option("--model", request.model)->required();
  app.add_option("--output", output)->required();
  app.add_option("--seed", request.seed)->required();
  app.add_option("--session", session);
  app.add_option("--sessions", sessions);
  app.add_option("--mesh", meshes, "NAME=FILE")->take_all()->expected(1);
  app.add_option("--hide", request.hide, "\"EFFECT name=value ...\", or outside")->take_all()->expected(1);
  CLI11_PARSE(app, argc, argv);
  for (const std::string& mesh : meshes) {
    const size_t equals = mesh.find('=');
    request.meshes[mesh.substr(0, equals)] = equals == std::string::npos ? "" : mesh.substr(equals + 1);
  }
  absl::StatusOr<hidden::Set> set = absl::UnknownError("");
  try {
    set = hidden::GenerateForPlan(request);
  } catch (const std::invalid_argument& error) {  // an effect that the oracle does not know
    set = absl::UnimplementedError(error.what());
  } catch (const std::exception& error) {
    set = absl::InternalError(error.what());
  }
  const absl::Status done = set.ok() ? WriteFileAtomically(output, set->csv) : set.status();
  if (done.ok()) return 0;
  fprintf(stderr, "%s\n", std::string(done.message()).c_str());
  return absl::IsUnimplemented(done) ? 3 : 1;
}
