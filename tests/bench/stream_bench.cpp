// End to end: what two threads make in this process, and what of it reaches C++ clients over loopback. One
// JSON object on stdout. The client runs on the same cores as the server, so its work is part of the price.
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <thread>

#include <nlohmann/json.hpp>

#include "client/source/connection/connection.h"
#include "client/source/dataset_stream.h"
#include "tests/bench/scene.h"

namespace touchstone::bench {
namespace {

using Clock = std::chrono::steady_clock;

double Seconds(Clock::time_point since) {
  return std::chrono::duration<double>(Clock::now() - since).count();
}

uint64_t ResidentBytes() {
  uint64_t pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

v1::StreamDatasetRequest Request(uint64_t samples, bool images, v1::ImageEncoding encoding) {
  v1::StreamDatasetRequest request;
  v1::DatasetSpec* spec = request.mutable_spec();
  spec->add_objects("lat20");
  spec->mutable_plan()->mutable_sphere();
  spec->mutable_model()->set_yaml(model::FormatModel(*ModelWith(kNoise)));
  spec->set_samples(samples);
  spec->set_seed(1);
  if (images) {
    spec->add_columns("image");
    spec->mutable_image()->set_encoding(encoding);
  }
  return request;
}

// Samples per second of a stream inside the process, without gRPC.
double InProcess(int threads, uint64_t samples, bool images, dataset::ImageEncoding encoding) {
  auto specification = Touches(Lat20(), kNoise);
  specification->samples = samples;
  if (images) {
    specification->columns = *dataset::ColumnChoice::FromNames({"image"});
    specification->image.encoding = encoding;
    specification->image.renderer = *image::CreateRenderer({});
  }
  ThreadPool pool(threads);
  const auto begin = Clock::now();
  auto stream = *dataset::DatasetStream::Create(specification, {}, &pool);
  uint64_t rows = 0;
  while (auto batch = *stream->Next({})) rows += batch->rows;
  return rows / Seconds(begin);
}

struct Streamed {
  double samples_per_s = 0;
  double first_batch_s = 0;
};

Streamed OverLoopback(int port, int streams, uint64_t samples, bool images, v1::ImageEncoding encoding) {
  std::vector<std::thread> clients;
  std::vector<double> first(streams);
  const auto begin = Clock::now();
  for (int k = 0; k < streams; ++k) {
    clients.emplace_back([&, k] {
      client::ConnectionOptions options;
      options.servers = {"127.0.0.1:" + std::to_string(port)};
      auto connection = *client::Connection::Open(options);
      v1::StreamDatasetRequest request = Request(samples, images, encoding);
      request.set_start_index(samples / streams * k);
      request.set_stop_index(samples / streams * (k + 1));
      const auto asked = Clock::now();
      auto stream = *client::DatasetStream::Open(connection.get(), request);
      client::Batch batch;
      bool any = false;
      while (*stream->Next(&batch)) {
        if (!any) first[k] = Seconds(asked);
        any = true;
      }
    });
  }
  for (std::thread& thread : clients) thread.join();
  return {samples / Seconds(begin), *std::max_element(first.begin(), first.end())};
}

nlohmann::json Run(uint64_t touches, uint64_t images) {
  service::ServerOptions options;
  options.listen = "127.0.0.1:0";
  options.supershape_triangles = kTriangles;
  options.threads = 2;
  const auto server = *service::Server::Start(options);
  OverLoopback(server->port(), 1, 1'000'000, false, v1::IMAGE_ENCODING_RAW);  // warm
  nlohmann::json result;
  result["in_process_1_thread"] = InProcess(1, touches, false, dataset::ImageEncoding::kRaw);
  result["in_process_2_threads"] = InProcess(2, touches, false, dataset::ImageEncoding::kRaw);
  result["first_batch_s"] =
      OverLoopback(server->port(), 1, 4096, false, v1::IMAGE_ENCODING_RAW).first_batch_s;
  result["one_stream"] =
      OverLoopback(server->port(), 1, touches, false, v1::IMAGE_ENCODING_RAW).samples_per_s;
  result["two_streams"] =
      OverLoopback(server->port(), 2, touches, false, v1::IMAGE_ENCODING_RAW).samples_per_s;
  const uint64_t before = ResidentBytes();
  OverLoopback(server->port(), 1, 10'000'000, false, v1::IMAGE_ENCODING_RAW);
  result["growth_over_10M_touches_bytes"] =
      static_cast<int64_t>(ResidentBytes()) - static_cast<int64_t>(before);
  result["resident_bytes"] = ResidentBytes();
  result["images_in_process"] = InProcess(2, images, true, dataset::ImageEncoding::kRaw);
  result["images_raw_streamed"] =
      OverLoopback(server->port(), 1, images, true, v1::IMAGE_ENCODING_RAW).samples_per_s;
  result["images_png_streamed"] =
      OverLoopback(server->port(), 1, images, true, v1::IMAGE_ENCODING_PNG).samples_per_s;
  return result;
}

}  // namespace
}  // namespace touchstone::bench

int main(int argc, char** argv) {
  const bool quick = argc > 1 && std::string(argv[1]) == "--quick";
  std::printf("%s\n",
              touchstone::bench::Run(quick ? 4'000'000 : 40'000'000, quick ? 1000 : 6000).dump(2).c_str());
  return 0;
}
