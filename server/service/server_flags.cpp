#include "server/service/server_flags.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <toml++/toml.h>
#include <CLI/CLI.hpp>

#include <functional>
#include <set>
#include <variant>
#include <vector>

#include "server/base/status.h"
#include "server/base/text.h"
#include "server/service/resources.h"

namespace touchstone {
namespace {

// One option: a key of the file, and with dashes a flag.
using Target = std::variant<std::string*, int*, double*, bool*, std::vector<std::string>*>;
struct Option {
  std::string key;
  std::string meaning;
  Target target;
};

// What the user says of meshes and renderers before it is checked.
struct Raw {
  std::vector<std::string> mesh, mesh_dir;
  std::string renderer = "auto";
};

std::vector<Option> OptionsOf(ServerFlags* flags, Raw* raw) {
  ServerOptions& o = flags->options;
  return {
      {"listen", "Address to listen on, HOST:PORT; port 0: any free one", &o.listen},
      {"mesh",
       "Serve a mesh file, NAME=FILE[,unit=mm|cm|m|inch][,up=z|y|x][,scale=S][,fit_mm=L]; may be repeated",
       &raw->mesh},
      {"mesh_dir",
       "Serve every OFF, OBJ, STL and PLY file of a folder, in mm and z up, named by its stem; may be "
       "repeated",
       &raw->mesh_dir},
      {"supershape_triangles", "About how many triangles each built-in supershape has",
       &o.supershape_triangles},
      {"models_dir", "Folder that keeps models; replicas may share it (default: memory)", &o.models_dir},
      {"sessions_dir", "Folder that keeps sessions; replicas may share it (default: memory)",
       &o.sessions_dir},
      {"default_model", "Model used when a request names none: a name, or a .yaml file", &o.default_model},
      {"threads", "Threads that simulate; 0: one a core", &o.threads},
      {"renderer", "auto (the faster one), egl or cpu", &raw->renderer},
      {"egl_device", "Index of the EGL device (touchstone doctor lists them); -1: the first that renders",
       &o.renderer.egl_device},
      {"most_batch_size", "Limit: samples a batch", &o.most_batch_size},
      {"most_touches_per_request", "Limit: explicit touches a request", &o.most_touches_per_request},
      {"most_images_per_request", "Limit: photographs a request", &o.most_images_per_request},
      {"most_streams", "Limit: dataset streams at once", &o.most_streams},
      {"most_message_mib", "Limit: size of one message, MiB", &o.most_message_mib},
      {"most_session_mib", "Limit: size of one stored session, MiB", &o.most_session_mib},
      {"most_sessions_mib", "Limit: size of all stored sessions together, MiB", &o.most_sessions_mib},
      {"most_diagnoses", "Limit: sets compared or diagnosed at once", &o.most_diagnoses},
      {"most_proposed_touches", "Limit: touches proposed a request", &o.most_proposed_touches},
      {"lease_window_s", "Seconds within which a lease must be renewed", &o.lease_window_s},
      {"drain_s", "Seconds that running calls get after SIGTERM", &o.drain_s},
      {"log_level", "trace, debug, info, warn, error or off", &flags->log_level},
      {"log_json", "Log lines as JSON", &flags->log_json},
  };
}

absl::Status Assign(const toml::node& node, const std::string& where, const Target& target) {
  const auto wrong = [&](const char* expected) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": must be ", expected));
  };
  if (auto* text = std::get_if<std::string*>(&target)) {
    if (!node.is_string()) return wrong("a text in quotes");
    **text = *node.value<std::string>();
  } else if (auto* whole = std::get_if<int*>(&target)) {
    const auto value = node.value_exact<int64_t>();
    if (!value || *value < INT32_MIN || *value > INT32_MAX) return wrong("a whole number");
    **whole = static_cast<int>(*value);
  } else if (auto* real = std::get_if<double*>(&target)) {
    if (!node.is_number()) return wrong("a number");
    **real = *node.value<double>();
  } else if (auto* yes = std::get_if<bool*>(&target)) {
    if (!node.is_boolean()) return wrong("true or false");
    **yes = *node.value<bool>();
  } else {
    std::vector<std::string>& list = *std::get<std::vector<std::string>*>(target);
    if (node.is_string()) {
      list = {*node.value<std::string>()};
      return absl::OkStatus();
    }
    const toml::array* array = node.as_array();
    if (array == nullptr) return wrong("a text, or a list of texts");
    list.clear();
    for (const toml::node& entry : *array) {
      if (!entry.is_string()) return wrong("a list of texts");
      list.push_back(*entry.value<std::string>());
    }
  }
  return absl::OkStatus();
}

// `set` holds the keys that flags gave: those win.
absl::Status ReadToml(const std::string& text, const std::string& origin, const std::vector<Option>& options,
                      const std::set<std::string>& set) {
  toml::table table;
  try {
    table = toml::parse(text, origin);
  } catch (const toml::parse_error& error) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ":", error.source().begin.line, ":",
                                                   error.source().begin.column, ": ",
                                                   std::string(error.description())));
  }
  std::vector<std::string> known;
  for (const Option& option : options) known.push_back(option.key);
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    const std::string where = absl::StrCat(origin, ":", key.source().begin.line, ": ", name);
    const auto option =
        std::find_if(options.begin(), options.end(), [&](const Option& o) { return o.key == name; });
    if (option == options.end())
      return absl::InvalidArgumentError(absl::StrCat(where, ": unknown key", DidYouMean(name, known)));
    if (set.count(name)) continue;
    TOUCHSTONE_RETURN_IF_ERROR(Assign(node, where, option->target));
  }
  return absl::OkStatus();
}

absl::Status Resolve(const Raw& raw, ServerFlags* flags) {
  ServerOptions& options = flags->options;
  for (const std::string& folder : raw.mesh_dir) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<MeshSource> sources, MeshSourcesOfFolder(folder));
    options.meshes.insert(options.meshes.end(), sources.begin(), sources.end());
  }
  for (const std::string& text : raw.mesh) {
    TOUCHSTONE_ASSIGN_OR_RETURN(MeshSource source, ParseMeshSource(text));
    options.meshes.push_back(std::move(source));
  }
  if (raw.renderer == "egl") {
    options.renderer.kind = RendererKind::kEgl;
  } else if (raw.renderer == "cpu") {
    options.renderer.kind = RendererKind::kCpu;
  } else if (raw.renderer != "auto") {
    return absl::InvalidArgumentError(
        absl::StrCat("renderer = '", raw.renderer, "'", DidYouMean(raw.renderer, {"auto", "egl", "cpu"})));
  }
  const std::vector<std::string> levels = {"trace", "debug", "info", "warn", "error", "off"};
  if (std::find(levels.begin(), levels.end(), flags->log_level) == levels.end())
    return absl::InvalidArgumentError(
        absl::StrCat("log_level = '", flags->log_level, "'", DidYouMean(flags->log_level, levels)));
  return absl::OkStatus();
}

}  // namespace

absl::Status ApplyToml(const std::string& text, const std::string& origin, ServerFlags* flags) {
  Raw raw;
  TOUCHSTONE_RETURN_IF_ERROR(ReadToml(text, origin, OptionsOf(flags, &raw), {}));
  return Resolve(raw, flags);
}

absl::StatusOr<ServerFlags> ParseServerFlags(int argc, const char* const* argv) {
  ServerFlags flags;
  Raw raw;
  const std::vector<Option> options = OptionsOf(&flags, &raw);
  CLI::App app(
      "Examples:\n"
      "  touchstone-server\n"
      "  touchstone-server --listen 0.0.0.0:50051 --mesh cup=cup.off,fit_mm=150,up=y\n"
      "  touchstone-server --config server.toml --threads 8\n"
      "\nThe virtual source: simulates touches, renders images and streams datasets over gRPC.\n"
      "It prints 'listening on HOST:PORT' when it is ready and drains on SIGTERM.",
      "touchstone-server");
  std::string config;
  bool version = false;
  app.add_option("--config", config,
                 "TOML file; its keys are the flags below with underscores (listen = \"127.0.0.1:0\")");
  app.add_flag("--version", version, "Print the version");
  for (const Option& option : options) {
    const std::string flag = "--" + absl::StrReplaceAll(option.key, {{"_", "-"}});
    std::visit(
        [&](auto* target) {
          using Value = std::remove_pointer_t<decltype(target)>;
          if constexpr (std::is_same_v<Value, bool>) {
            app.add_flag(flag, *target, option.meaning);
          } else if constexpr (std::is_same_v<Value, std::vector<std::string>>) {
            app.add_option(flag, *target, option.meaning)->allow_extra_args(false);
          } else {
            app.add_option(flag, *target, option.meaning)->capture_default_str();
          }
        },
        option.target);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    std::fputs(app.help().c_str(), stdout);
    flags.done = true;
    return flags;
  } catch (const CLI::ExtrasError& error) {
    std::vector<std::string> known = {"--config", "--version", "--help"};
    for (const Option& option : options)
      known.push_back("--" + absl::StrReplaceAll(option.key, {{"_", "-"}}));
    const std::vector<std::string> extras = app.remaining();
    const std::string word = extras.empty() ? "" : extras[0].substr(0, extras[0].find('='));
    return absl::InvalidArgumentError(absl::StrCat("unknown flag ", word, DidYouMean(word, known)));
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(error.what());
  }
  if (version) {
    std::printf("touchstone-server %s\n", kVersion);
    flags.done = true;
    return flags;
  }
  if (!config.empty()) {
    std::set<std::string> set;
    for (const Option& option : options)
      if (app.count("--" + absl::StrReplaceAll(option.key, {{"_", "-"}})) > 0) set.insert(option.key);
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::string text, ReadFile(config, 1 << 20));
    TOUCHSTONE_RETURN_IF_ERROR(ReadToml(text, config, options, set));
  }
  TOUCHSTONE_RETURN_IF_ERROR(Resolve(raw, &flags));
  return flags;
}

}  // namespace touchstone
