// touchstone doctor: is everything in order here? Processor, ray casting, renderers, the source
// and its limits.
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <set>
#include <thread>

#include "client/cli/common/child_program.h"
#include "client/cli/common/common.h"
#include "client/cli/common/terminal.h"
#include "client/workbench/page.h"
#include "server/base/process/version.h"
#include "server/base/status.h"
#include "server/diagnosis/boards/board_pictures.h"
#include "server/geometry/surface/surface.h"
#include "server/image/renderers/renderer.h"
#include "server/service/channel/channel.h"

namespace touchstone::cli {
namespace {

struct Processor {
  std::string model = "unknown";
  std::set<std::string> flags;
};

Processor ReadProcessor() {
  Processor processor;
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const size_t colon = line.find(": ");
    if (colon == std::string::npos) continue;
    if (line.rfind("model name", 0) == 0) processor.model = line.substr(colon + 2);
    if (line.rfind("flags", 0) != 0 && line.rfind("Features", 0) != 0) continue;
    for (const absl::string_view flag : absl::StrSplit(line.substr(colon + 2), ' ', absl::SkipEmpty()))
      processor.flags.emplace(flag);
    break;
  }
  return processor;
}

// The instructions that this program was compiled to use, by their names in /proc/cpuinfo.
std::vector<std::string> FlagsOfBuild() {
  std::vector<std::string> flags;
#ifdef __SSE4_2__
  flags.push_back("sse4_2");
#endif
#ifdef __AVX__
  flags.push_back("avx");
#endif
#ifdef __AVX2__
  flags.push_back("avx2");
#endif
#ifdef __FMA__
  flags.push_back("fma");
#endif
#ifdef __BMI2__
  flags.push_back("bmi2");
#endif
#ifdef __F16C__
  flags.push_back("f16c");
#endif
#ifdef __AVX512F__
  flags.push_back("avx512f");
#endif
  return flags;
}

// One finding: good or bad, in words.
struct Finding {
  std::string topic;
  bool good = true;
  std::string text;
};

class Doctor {
 public:
  explicit Doctor(const Cli& cli) : cli_(cli) {}

  absl::Status Run() {
    CheckProcessor();
    CheckPrograms();
    CheckOpenCv();
    CheckRenderers();
    CheckProxy();
    const absl::Status source = CheckSource();
    if (cli_.output().json)
      PrintJson(json_);
    else
      TOUCHSTONE_RETURN_IF_ERROR(cli_.Print(Text()));
    return source;
  }

 private:
  void Add(const std::string& topic, bool good, const std::string& text) {
    findings_.push_back({topic, good, text});
  }

  void CheckProcessor() {
    const Processor processor = ReadProcessor();
    std::vector<std::string> missing;
    for (const std::string& flag : FlagsOfBuild())
      if (!processor.flags.empty() && processor.flags.count(flag) == 0) missing.push_back(flag);
    const unsigned cores = std::thread::hardware_concurrency();
    Add("Processor", true, absl::StrCat(processor.model, ", ", cores, cores == 1 ? " thread" : " threads"));
    const std::vector<std::string> used = FlagsOfBuild();
    if (missing.empty())
      Add("Build", true,
          absl::StrCat("version ", kVersion, ", uses ",
                       used.empty() ? "the compiler's default instructions" : absl::StrJoin(used, " "),
                       ", all of which this processor has"));
    else
      Add("Build", false,
          absl::StrCat("uses instructions that this processor lacks: ", absl::StrJoin(missing, " "),
                       ". Configure with -DTOUCHSTONE_ARCH=native, or with an empty value"));
    Add("Rays", true, geometry::EmbreeDescription());
    json_["processor"] = {{"model", processor.model}, {"threads", cores}};
    json_["build"] = {
        {"version", std::string(kVersion)}, {"instructions", used}, {"instructions_missing", missing}};
    json_["embree"] = geometry::EmbreeDescription();
  }

  // What touchstone demo needs: the other programs, a line to the emulated end effector, and the page.
  void CheckPrograms() {
    std::vector<std::string> missing;
    for (const char* name :
         {"touchstone-server", "touchstone-gateway", "touchstone-rig-emulator", "touchstone-probe"})
      if (::access(PathBesideThisProgram(name).c_str(), X_OK) != 0) missing.push_back(name);
    if (missing.empty())
      Add("Programs", true, "server, gateway, emulated rig and probe lie beside this one");
    else
      Add("Programs", false,
          absl::StrCat(absl::StrJoin(missing, ", "), missing.size() == 1 ? " is" : " are", " not there, in ",
                       PathBesideThisProgram(""),
                       "; touchstone demo needs the gateway and the emulated rig"));
    const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY);
    if (terminal < 0)
      Add("Emulated rig", false,
          absl::StrCat("there are no pseudo-terminals (/dev/ptmx: ", std::strerror(errno),
                       "), which stand in for its serial line; touchstone demo needs them: mount devpts"));
    else
      ::close(terminal);
    const absl::StatusOr<absl::string_view> page = workbench::PageTemplate();
    Add("Page", page.ok(),
        page.ok() ? "built in: --html and workbench" : std::string(page.status().message()));
    json_["programs_missing"] = missing;
    json_["pseudo_terminals"] = terminal >= 0;
    json_["page"] = page.ok();
  }

  void CheckOpenCv() {
    // A build without OpenCV knows no folder of pictures, not even one that is not there.
    const bool built_in = !absl::IsUnimplemented(
        diagnosis::boards::ReadBoardPictures("", diagnosis::boards::BoardLayout()).status());
    Add("OpenCV", built_in,
        built_in ? "built in: a rig's camera, pictures of boards"
                 : "not in this build: touchstone-gateway has no camera, and diagnose --board cannot find "
                   "corners. All else works; for these build from the source");
    json_["opencv"] = built_in;
  }

  void CheckRenderers() {
    // An unknown kind is refused where the source is connected.
    const image::RendererOptions options = cli_.Renderer().value_or(image::RendererOptions());
    const absl::StatusOr<std::shared_ptr<image::Renderer>> chosen = image::CreateRenderer(options);
    Json devices = Json::array();
    for (const image::EglDevice& device : image::ListEglDevices()) {
      const std::string name =
          absl::StrCat("device ", device.index, ", ", device.name.empty() ? "without a name" : device.name,
                       device.vendor.empty() ? "" : " (" + device.vendor + ")");
      Add("EGL", device.renders,
          device.renders ? absl::StrCat(name, ": renders", device.software ? ", in software" : ", on a GPU")
                         : absl::StrCat(name, ": does not render, ", device.problem));
      devices.push_back({{"index", device.index},
                         {"vendor", device.vendor},
                         {"name", device.name},
                         {"renders", device.renders},
                         {"software", device.software},
                         {"problem", device.problem}});
    }
    json_["egl_devices"] = devices;
    if (devices.empty())
      Add("EGL", true,
          "no device: no GPU driver and no Mesa is installed, or this build has no EGL. Images are made "
          "by the CPU renderer");
    if (chosen.ok()) {
      const char* why = options.kind == image::RendererKind::kAuto ? "" : " (asked for)";
      Add("Images", true, absl::StrCat((*chosen)->description(), why));
      json_["renderer"] = {{"name", (*chosen)->name()}, {"description", (*chosen)->description()}};
    } else {
      Add("Images", false, std::string(chosen.status().message()));
      json_["renderer"] = {{"problem", std::string(chosen.status().message())}};
    }
  }

  void CheckProxy() {
    json_["proxies"] = Json::object();
    for (const std::string& server : SplitCommas(cli_.source().servers)) {
      const std::string proxy = service::ProxyFor(server);
      json_["proxies"][server] = proxy;
      Add("Proxy", true,
          proxy.empty() ? absl::StrCat(server, " is reached without one")
                        : absl::StrCat(server, " is reached through ", proxy,
                                       "; hosts in no_proxy are reached without it"));
    }
    if (json_["proxies"].empty()) Add("Proxy", true, "none: the source is in this process");
  }

  absl::Status CheckSource() {
    const absl::StatusOr<std::unique_ptr<client::Connection>> connection = cli_.Connect();
    const absl::StatusOr<v1::DescribeResponse> response =
        connection.ok() ? (*connection)->Call(&v1::Source::Stub::Describe, v1::DescribeRequest())
                        : absl::StatusOr<v1::DescribeResponse>(connection.status());
    if (!response.ok()) {
      Add("Source", false, "the error below says why it cannot be used");
      json_["source"] = {{"reachable", false}, {"problem", std::string(response.status().message())}};
      return response.status();
    }
    const v1::DescribeResponse& d = *response;
    const std::string where =
        (*connection)->embedded() ? "in this process" : "at " + (*connection)->address();
    Add("Source", true,
        absl::StrCat(client::SourceKindName(d.kind()), " source ", where, ", version ", d.version(),
                     d.default_model().empty() ? ""
                                               : ", default model " + d.default_model() + " (hash " +
                                                     d.default_model_hash().substr(0, 12) + ")"));
    Add("Plans", true, absl::StrJoin(d.plans(), ", "));
    if (d.renderer_description().empty())
      Add("Camera", false, "this source makes no images");
    else
      Add("Camera", true, d.renderer_description());
    Add("Limits", true,
        absl::StrCat(d.max_touches_per_request(), " touches and ", d.max_images_per_request(),
                     " images a request, images up to ", d.max_image_side(), " x ", d.max_image_side(),
                     " pixels, batches of up to ", d.max_batch_size(), " samples, ", d.max_fingers(),
                     " fingers"));
    json_["source"] = {{"reachable", true},
                       {"address", (*connection)->address()},
                       {"kind", client::SourceKindName(d.kind())},
                       {"version", d.version()},
                       {"plans", std::vector<std::string>(d.plans().begin(), d.plans().end())},
                       {"default_model", d.default_model()},
                       {"default_model_hash", d.default_model_hash()},
                       {"renderer", d.renderer_description()},
                       {"max_touches_per_request", d.max_touches_per_request()},
                       {"max_images_per_request", d.max_images_per_request()},
                       {"max_image_side_px", d.max_image_side()},
                       {"max_batch_size", d.max_batch_size()},
                       {"max_indices_per_request", d.max_indices_per_request()},
                       {"max_fingers", d.max_fingers()},
                       {"lease_required", d.lease_required()},
                       {"touch_duration_s", d.touch_duration_s()},
                       {"clock_uncertainty_s", d.clock_uncertainty_s()}};
    return absl::OkStatus();
  }

  std::string Text() const {
    std::string text;
    for (const Finding& finding : findings_) {
      std::string line = absl::StrCat(finding.good ? "ok  " : "!!  ", finding.topic);
      line.append(line.size() < 15 ? 15 - line.size() : 1, ' ');
      absl::StrAppend(&text, line, Wrap(finding.text, TextWidth(), 15), "\n");
    }
    return text;
  }

  const Cli& cli_;
  std::vector<Finding> findings_;
  Json json_ = Json::object();
};

}  // namespace

void AddDoctor(Cli* cli) {
  CLI::App* command = cli->AddCommand(
      nullptr, "doctor",
      "Says whether everything is in order here: processor, ray casting, renderers, the source.",
      "touchstone doctor\n"
      "touchstone doctor --server 127.0.0.1:50051\n"
      "touchstone doctor --renderer egl --egl-device 0",
      [cli] { return Doctor(*cli).Run(); });
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
