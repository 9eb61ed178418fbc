#include "ros2_services.hpp"

#include <rcl/error_handling.h>
#include <rcl/graph.h>
#include <rmw_fastrtps_shared_cpp/custom_service_info.hpp>

#include "ros2_ends.hpp"

namespace plane {
namespace {

void on_arrivals(const void * arrived, size_t number) { (*static_cast<const std::function<void(size_t)> *>(arrived))(number); }

}  // namespace

Ros2Client::Ros2Client(rcl_node_t * node, const rosidl_service_type_support_t * type, const std::string & service)
: node_(node), client_(rcl_get_zero_initialized_client()) {
  const rcl_client_options_t options = rcl_client_get_default_options();
  require(rcl_client_init(&client_, node, type, service.c_str(), &options), "can't call", service);
}

Ros2Client::~Ros2Client() {
  stop_listening();
  if (rcl_client_fini(&client_, node_) != RCL_RET_OK) rcl_reset_error();
}

void Ros2Client::listen(std::function<void(size_t)> arrived) {
  arrived_ = std::move(arrived);
  require(rcl_client_set_on_new_response_callback(&client_, on_arrivals, &arrived_), "can't listen to", "a client");
}

void Ros2Client::stop_listening() {
  if (rcl_client_set_on_new_response_callback(&client_, nullptr, nullptr) != RCL_RET_OK) rcl_reset_error();
}

bool Ros2Client::ready() const {
  bool available = false;
  if (rcl_service_server_is_available(node_, &client_, &available) != RCL_RET_OK) rcl_reset_error();
  return available;
}

int64_t Ros2Client::send(const Outgoing & request) const {
  int64_t sequence = -1;
  if (rcl_send_request(&client_, &request, &sequence) == RCL_RET_OK) return sequence;
  rcl_reset_error();
  return -1;
}

int64_t Ros2Client::take(Incoming & incoming) const {
  rmw_request_id_t whose{};
  const rcl_ret_t code = rcl_take_response(&client_, &whose, &incoming);
  if (code == RCL_RET_OK) return whose.sequence_number;
  incoming.touched = false;
  rcl_reset_error();
  return -1;
}

Ros2Service::Ros2Service(rcl_node_t * node, const rosidl_service_type_support_t * type, const std::string & service)
: node_(node), service_(rcl_get_zero_initialized_service()) {
  const rcl_service_options_t options = rcl_service_get_default_options();
  require(rcl_service_init(&service_, node, type, service.c_str(), &options), "can't serve", service);
}

Ros2Service::~Ros2Service() {
  stop_listening();
  if (rcl_service_fini(&service_, node_) != RCL_RET_OK) rcl_reset_error();
}

void Ros2Service::listen(std::function<void(size_t)> arrived) {
  arrived_ = std::move(arrived);
  require(rcl_service_set_on_new_request_callback(&service_, on_arrivals, &arrived_), "can't listen to", "a service");
}

void Ros2Service::stop_listening() {
  if (rcl_service_set_on_new_request_callback(&service_, nullptr, nullptr) != RCL_RET_OK) rcl_reset_error();
}

void Ros2Service::take(Incoming & incoming, rmw_request_id_t & request_id) const {
  if (rcl_take_request(&service_, &request_id, &incoming) == RCL_RET_OK) return;
  incoming.touched = false;
  rcl_reset_error();
}

bool Ros2Service::answer(const Outgoing & response, rmw_request_id_t request_id) const {
  auto * bytes = const_cast<Outgoing *>(&response);  // rcl only reads it, but says otherwise
  if (rcl_send_response(&service_, &request_id, bytes) == RCL_RET_OK) return true;
  rcl_reset_error();
  return false;
}

// rmw does not pass on this question to DDS, as it does for publishers.
void Ros2Service::wait_for_arrival(int64_t most_ns) const {
  const auto * service = static_cast<const CustomServiceInfo *>(rcl_service_get_rmw_handle(&service_)->data);
  // A duration of Fast DDS, whose name changed from version 2 to 3: seconds and nanoseconds.
  service->response_writer_->wait_for_acknowledgments({static_cast<int32_t>(most_ns / 1'000'000'000), static_cast<uint32_t>(most_ns % 1'000'000'000)});
}

}  // namespace plane
