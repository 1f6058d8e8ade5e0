// The options that say where touches come from, and the connection that they name.
#include <cstdlib>
#include <map>

#include "client/cli/common/common.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/service/channel/channel.h"

namespace touchstone::cli {
namespace {

constexpr char kGroup[] = "Source";
constexpr double kMaxWaitS = 3600;
constexpr char kServerVariable[] = "TOUCHSTONE_SERVER";  // addresses, as --server takes them
constexpr char kNoServer[] = "none";                     // of --server, against the variable

}  // namespace

absl::Status Cli::EmbeddedOnly(absl::string_view option) const {
  return absl::InvalidArgumentError(
      source_.servers_from_environment
          ? absl::StrCat(option, ": works only in this process, and ", kServerVariable,
                         " names a server; add --server ", kNoServer,
                         ", or give it to touchstone-server instead (the same option there)")
          : absl::StrCat(option,
                         ": works only without --server; give it to touchstone-server instead (the same "
                         "option there)"));
}

absl::Status Cli::ChooseServers(const CLI::App* command) {
  const CLI::Option* option = command->get_option_no_throw("--server");
  if (option == nullptr) return absl::OkStatus();
  if (source_.servers == std::vector<std::string>{kNoServer}) {
    source_.servers.clear();
    return absl::OkStatus();
  }
  const char* const named = std::getenv(kServerVariable);
  if (option->count() > 0 || named == nullptr || *named == '\0' || absl::string_view(named) == kNoServer)
    return absl::OkStatus();
  if (*named == '/' || *named == '.')
    return absl::InvalidArgumentError(
        absl::StrCat(kServerVariable, ": '", named,
                     "' is a path; HOST:PORT was expected (TOUCHSTONE_SERVER_PROGRAM names the program that "
                     "Python starts)"));
  source_.servers = {named};
  source_.servers_from_environment = true;
  return absl::OkStatus();
}

void Cli::AddServerOptions(CLI::App* command, const std::string& what) {
  command->add_option("--server", source_.servers, what)
      ->type_name("HOST:PORT")
      ->group(kGroup)
      ->delimiter(',')
      ->take_all()
      ->expected(1);
  command
      ->add_option("--wait-s", source_.wait_s,
                   "How long to wait for a server that is starting, from 0. Default: 10")
      ->type_name("S")
      ->group(kGroup);
  AddCredentialOptions(command);
}

void Cli::AddCredentialOptions(CLI::App* command) {
  const auto add = [&](const std::string& name, std::string* value, const std::string& text) {
    command->add_option(name, *value, text)->type_name("FILE")->group(kGroup);
  };
  client::Credentials& shown = source_.credentials;
  add("--tls-ca", &shown.tls_ca,
      "Speak TLS with the server: the CA of its certificate (PEM), or system. Default: TOUCHSTONE_TLS_CA");
  add("--tls-cert", &shown.tls_cert, "Client certificate (PEM). Default: TOUCHSTONE_TLS_CERT");
  add("--tls-key", &shown.tls_key, "Its private key (PEM). Default: TOUCHSTONE_TLS_KEY");
  add("--token-file", &shown.token_file,
      "File with the token that the server asks for. Default: TOUCHSTONE_TOKEN, or TOUCHSTONE_TOKEN_FILE");
}

void Cli::AddRigOptions(CLI::App* command) {
  AddServerOptions(command, "The touchstone-gateway that works the rig. Default: TOUCHSTONE_SERVER");
}

void Cli::AddRigBeside(CLI::App* command) {
  command
      ->add_option("--rig", source_.rig,
                   "A touchstone-gateway, whose rig the page then works: plan, dry run, touches, stop")
      ->type_name("HOST:PORT")
      ->group(kGroup);
}

void Cli::AddSourceOptions(CLI::App* command) {
  AddServerOptions(command,
                   "A touchstone-server, or several with commas (the next one takes over from a lost one); "
                   "none: simulate in this process. Default: TOUCHSTONE_SERVER, else none");
  const auto add = [&](const std::string& name, auto& value, const std::string& type,
                       const std::string& text) {
    return command->add_option(name, value, text)->type_name(type)->group(kGroup);
  };
  add("--mesh", source_.meshes, "NAME=FILE",
      "A mesh to touch besides the built-in shapes, repeatable; with what the file does not say: "
      "NAME=FILE,unit=mm|cm|m|inch,up=x|y|z,scale=1,fit_mm=150")
      ->take_all()
      ->expected(1);
  add("--mesh-dir", source_.mesh_folder, "FOLDER", "Every mesh file of a folder, named by its stem");
  add("--renderer", source_.renderer, "KIND",
      "auto, egl or cpu: what makes images. Default: auto, the faster one");
  add("--egl-device", source_.egl_device, "N", "EGL device to render on, as touchstone doctor numbers them");
  add("--threads", source_.threads, "N", "Threads that simulate. Default: one per core");
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::Connect() const {
  if (!source_.servers.empty()) {
    const char* embedded_only = !source_.meshes.empty()        ? "--mesh"
                                : !source_.mesh_folder.empty() ? "--mesh-dir"
                                                               : nullptr;
    if (embedded_only != nullptr) return EmbeddedOnly(embedded_only);
    return ConnectWithMeshes({});
  }
  std::vector<source::MeshSpec> meshes;
  if (!source_.mesh_folder.empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(meshes, service::MeshSpecsOfFolder(source_.mesh_folder));
  }
  for (const std::string& text : source_.meshes) {
    TOUCHSTONE_ASSIGN_OR_RETURN(source::MeshSpec mesh, service::ParseMeshSpec(text));
    meshes.push_back(std::move(mesh));
  }
  return ConnectWithMeshes(std::move(meshes));
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::ConnectNow() const {
  client::ConnectionOptions options;
  options.servers = SplitCommas(source_.servers);
  options.credentials = client::WithEnvironment(source_.credentials);
  return client::Connection::Open(std::move(options));
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::ConnectToRigBeside() const {
  TOUCHSTONE_RETURN_IF_ERROR(CheckWait());
  return ConnectToServers({source_.rig});
}

absl::Status Cli::CheckWait() const {
  if (source_.wait_s >= 0 && source_.wait_s <= kMaxWaitS) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("--wait-s: ", ShortestNumber(source_.wait_s), " is out of range; 0 to ", kMaxWaitS));
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::ConnectToServers(
    std::vector<std::string> servers) const {
  client::ConnectionOptions options;
  options.servers = std::move(servers);
  options.credentials = client::WithEnvironment(source_.credentials);
  options.wait_s = source_.wait_s;
  options.log = [this](const std::string& line) { Log(line); };
  TOUCHSTONE_ASSIGN_OR_RETURN(auto connection, client::Connection::Open(std::move(options)));
  const std::string proxy = service::ProxyFor(connection->address());
  Detail(absl::StrCat("connected to ", connection->address(), proxy.empty() ? "" : " through ", proxy));
  return connection;
}

absl::StatusOr<std::unique_ptr<client::Connection>> Cli::ConnectWithMeshes(
    std::vector<source::MeshSpec> meshes) const {
  client::ConnectionOptions options;
  options.servers = SplitCommas(source_.servers);
  TOUCHSTONE_RETURN_IF_ERROR(Renderer().status());
  if (!options.servers.empty()) {
    const char* embedded_only = source_.threads != 0      ? "--threads"
                                : source_.egl_device >= 0 ? "--egl-device"
                                                          : nullptr;
    if (embedded_only != nullptr) return EmbeddedOnly(embedded_only);
    TOUCHSTONE_RETURN_IF_ERROR(CheckWait());
    auto opened = ConnectToServers(std::move(options.servers));
    if (!opened.ok() && source_.servers_from_environment)
      return absl::Status(opened.status().code(),
                          absl::StrCat(opened.status().message(), " (", kServerVariable,
                                       " names it; --server ", kNoServer, ": in this process)"));
    return opened;
  }
  const client::Credentials& shown = source_.credentials;
  const char* const server_only = !shown.tls_ca.empty()                               ? "--tls-ca"
                                  : !shown.tls_cert.empty() || !shown.tls_key.empty() ? "--tls-cert"
                                  : !shown.token_file.empty()                         ? "--token-file"
                                                                                      : nullptr;
  if (server_only != nullptr && source_.rig.empty())
    return absl::InvalidArgumentError(absl::StrCat(server_only, ": works only with --server HOST:PORT"));
  service::ServerOptions& embedded = options.embedded;
  embedded.meshes = std::move(meshes);
  if (source_.threads < 0)
    return absl::InvalidArgumentError(
        absl::StrCat("--threads: ", source_.threads, "; 1 or more, or 0 for one per core"));
  embedded.threads = source_.threads;
  TOUCHSTONE_ASSIGN_OR_RETURN(embedded.renderer, Renderer());
  return client::Connection::Open(std::move(options));
}

absl::StatusOr<image::RendererOptions> Cli::Renderer() const {
  static const std::map<std::string, image::RendererKind> kinds = {{"auto", image::RendererKind::kAuto},
                                                                   {"egl", image::RendererKind::kEgl},
                                                                   {"cpu", image::RendererKind::kCpu}};
  std::vector<std::string> names;
  for (const auto& [name, kind] : kinds) names.push_back(name);
  TOUCHSTONE_RETURN_IF_ERROR(OneOf("--renderer", source_.renderer, names).status());
  image::RendererOptions options;
  options.kind = kinds.at(source_.renderer);
  options.egl_device = source_.egl_device;
  return options;
}

}  // namespace touchstone::cli
