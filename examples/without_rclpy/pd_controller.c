/* Lifts the pendulum to an angle by PD control with gravity compensation, in lockstep: what
 * examples/pd_controller.py does, in C on Eclipse Cyclone DDS, without any ROS. How it is built and
 * started: docs/without_rclpy.md. */

#include <dds/dds.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "JointState.h"

typedef sensor_msgs_msg_dds__JointState_ JointState;

static const double STIFFNESS = 50.0, DAMPING = 5.0; /* N m/rad, N m s/rad */
static const double TARGET = 1.0;                    /* rad; 0 hangs straight down */
static const double WEIGHT_TIMES_ARM = 1.0 * 9.81 * 0.5; /* N m: 1 kg, half a metre from the hinge */

static dds_entity_t checked(dds_entity_t entity, const char *what) {
  if (entity < 0) {
    fprintf(stderr, "error: %s: %s\n", what, dds_strretcode(-entity));
    exit(2);
  }
  return entity;
}

/* A writer or reader as ROS has it: `rt/` before the topic's name, reliable, the last 10. */
static dds_entity_t on_topic(dds_entity_t participant, const char *name, bool writes) {
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  dds_entity_t topic = checked(
      dds_create_topic(participant, &sensor_msgs_msg_dds__JointState__desc, name, NULL, NULL), name);
  dds_entity_t end = writes ? dds_create_writer(participant, topic, qos, NULL)
                            : dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return checked(end, name);
}

/* Answers a state with `kp (target - q) - kd v + m g l sin(q)`; its stamp says which state. */
static void answer(const JointState *state, dds_entity_t torques) {
  for (uint32_t i = 0; i < state->name._length; i++) {
    if (strcmp(state->name._buffer[i], "hinge") != 0) continue; /* the order may change */
    double q = state->position._buffer[i], v = state->velocity._buffer[i];
    double effort = STIFFNESS * (TARGET - q) - DAMPING * v + WEIGHT_TIMES_ARM * sin(q);
    char *name = state->name._buffer[i];
    JointState torque = {.header = state->header}; /* with the session, its `frame_id` */
    torque.name = (dds_sequence_string){1, 1, &name, false};
    torque.effort = (dds_sequence_double){1, 1, &effort, false};
    checked(dds_write(torques, &torque), "joint_torques");
  }
}

int main(void) {
  const char *domain = getenv("ROS_DOMAIN_ID");
  signal(SIGINT, _exit);
  signal(SIGTERM, _exit);
  dds_entity_t participant = checked(
      dds_create_participant(domain ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL), "participant");
  dds_entity_t torques = on_topic(participant, "rt/joint_torques", true);
  dds_entity_t states = on_topic(participant, "rt/joint_states", false);
  dds_entity_t waitset = checked(dds_create_waitset(participant), "waitset");
  dds_waitset_attach(waitset, dds_create_readcondition(states, DDS_ANY_STATE), 0);
  for (;;) {
    void *sample = NULL;
    dds_sample_info_t info;
    dds_publication_matched_status_t heard;
    dds_waitset_wait(waitset, NULL, 0, DDS_INFINITY);
    while (dds_take(states, &sample, &info, 1, 1) > 0) {
      dds_get_publication_matched_status(torques, &heard);
      if (info.valid_data && heard.current_count > 0) /* else the state is published again */
        answer(sample, torques);
      dds_return_loan(states, &sample, 1);
    }
  }
}
