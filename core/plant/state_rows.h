/* Rows of numbers as states of a plant, and back. */
#ifndef TOWLINE_PLANT_STATE_ROWS_H
#define TOWLINE_PLANT_STATE_ROWS_H

#include "plant/state.h"

static kind kind_of(const towline_robot *robot, const towline_plant *settings) {
    kind found = ELASTIC;
    for (int i = 0; i < robot->cables && settings->drive != TOWLINE_TENSIONS; i++) {
        if (robot->cable[i].stiffness == 0) { return CONSTRAINED; }
        if (settings->drive == TOWLINE_FORCES && robot->cable[i].winch_friction > 0) { found = WITH_FRICTION; }
    }
    return found;
}

/* Set what is the same for all rows. */
static void set_plant(plant *p, const towline_robot *robot, const towline_plant *settings) {
    p->robot = robot;
    p->settings = settings;
    p->bodies = 1 + robot->carriers;
    p->cables = robot->cables;
    p->locates = settings->located && settings->drive != TOWLINE_TENSIONS;
    p->kind = kind_of(robot, settings);
    p->has_winches = 0;
    for (int i = 0; i < p->cables; i++) {
        p->has_winches |= robot->cable[i].has_winch;
        for (int j = 0; j < 3; j++) { p->attachment[i][j] = robot->cable[i].attachment[j] - robot->com[j]; }
    }
}

/* Take the bodies and unstrained lengths of a row. */
static void take_motion(const plant *p, const double *row, motion *now) {
    const int m = p->cables;
    const double *cables = row + TOWLINE_BODY_NUMBERS * p->bodies;
    memcpy(now->body, row, (size_t)p->bodies * sizeof now->body[0]);
    memcpy(now->length, cables, (size_t)m * sizeof cables[0]);
    memcpy(now->rate, cables + m, (size_t)m * sizeof cables[0]);
}

static int condition_of(double number) {
    return number == TOWLINE_WORKS ? TOWLINE_WORKS : number == TOWLINE_CUT ? TOWLINE_CUT : TOWLINE_STUCK;
}

/* Take a row as the state, and forget the row before. */
static void take_state(plant *p, const double *row, motion *now) {
    const int m = p->cables;
    const double *references = row + TOWLINE_BODY_NUMBERS * p->bodies + 2 * m;
    take_motion(p, row, now);
    memcpy(p->reference, references, (size_t)m * sizeof references[0]);
    for (int i = 0; i < m; i++) { p->condition[i] = condition_of(references[m + i]); }
    memset(p->body, 0, (size_t)p->bodies * sizeof p->body[0]);
    memset(p->cable, 0, (size_t)m * sizeof p->cable[0]);
    p->taut.holds = 0;
}

/* Make a derivative zero. */
static void clear(const plant *p, motion *change) {
    memset(change->body, 0, (size_t)p->bodies * sizeof change->body[0]);
    memset(change->length, 0, (size_t)p->cables * sizeof change->length[0]);
    memset(change->rate, 0, (size_t)p->cables * sizeof change->rate[0]);
}

static void record_state(const plant *p, const motion *now, double *row) {
    const int m = p->cables;
    double *cables = row + TOWLINE_BODY_NUMBERS * p->bodies;
    memcpy(row, now->body, (size_t)p->bodies * sizeof now->body[0]);
    memcpy(cables, now->length, (size_t)m * sizeof cables[0]);
    memcpy(cables + m, now->rate, (size_t)m * sizeof cables[0]);
    memcpy(cables + 2 * m, p->reference, (size_t)m * sizeof cables[0]);
    for (int i = 0; i < m; i++) { cables[3 * m + i] = p->condition[i]; }
}

static void record_tensions(const plant *p, double *row) {
    for (int i = 0; i < p->cables; i++) { row[i] = p->cable[i].tension; }
}

#endif
